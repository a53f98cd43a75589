"""Accuracy and speed of the relief solver on a known bump, against SciPy's SuperLU in its place.

    python -m benchmarks.bench_shading

A dome of 161 x 161 vertices under known light, with noise of one display value. Prints how far normals
are from the true ones near the bump (smooth mesh, relief), CPU seconds of the relief of a frame and of
the combination of normals and positions (Nehab 2005), each with our factorisation and with SuperLU, the
ratios of these, and the peak memory of the process.
"""

from __future__ import annotations

import resource
import time

import numpy as np
from scipy.sparse.linalg import splu

from tests.unit import test_relief as scenes
from vermilion.detail.relief import combine as combination
from vermilion.detail.relief import high_pass as detail
from vermilion.detail.relief import relief
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.geometry.mesh import triangle_normals, vertex_normals

SIDE = 161


class SuperLU:
    """SciPy's factorisation behind the interface of ours."""

    def __init__(self, matrix):
        self.solve = splu(matrix.tocsc()).solve


def main() -> None:
    scenes.SIDE = SIDE
    topology, points = scenes.dome()
    light, n = scenes.clip(topology, noise=1), len(topology.skin)
    normals = vertex_normals(points, topology.skin)
    moved = points + scenes.bump(points)[:, None] * normals
    true = vertex_normals(moved, topology.skin)
    grain = np.random.default_rng(0).normal(size=(n, 1))
    shown = triangle_normals(moved, topology.skin) @ scenes.FACING.T
    smooth = triangle_normals(points, topology.skin) @ scenes.FACING.T
    observed = SkinObservation(light.values(shown) + grain, np.ones(n), smooth)
    settings = relief.ReliefSettings(detail_mm=20.0)
    near = np.hypot(points[:, 0] - 5, points[:, 1]) < 12
    ours, seconds = relief.CholeskyFactor, {}
    for name, factor in (("cholespy", ours), ("SuperLU", SuperLU)):
        for module in (relief, detail, combination):
            module.CholeskyFactor = factor
        start = time.process_time()
        found = relief.solve_relief(points, scenes.FACING, observed, light, topology, settings)
        middle = time.process_time()
        after = vertex_normals(points + found[:, None] * normals, topology.skin)
        combination.combine_positions_and_normals(points, normals, after, topology, 0.1, found)
        seconds[name] = middle - start, time.process_time() - middle
        print(f"{name}: relief {seconds[name][0]:.2f} s, combination {seconds[name][1]:.2f} s")
    before_deg = scenes.degrees_apart(normals, true)[near].mean()
    after_deg = scenes.degrees_apart(after, true)[near].mean()
    print(f"normals: smooth {before_deg:.2f} degrees off, with relief {after_deg:.2f}")
    ratios = np.divide(seconds["cholespy"], seconds["SuperLU"])
    print(f"ratio: relief {ratios[0]:.2f}, combination {ratios[1]:.2f}")
    print(f"peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")


if __name__ == "__main__":
    main()
