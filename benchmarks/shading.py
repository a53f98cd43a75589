"""Accuracy and speed of the relief from shading on a known bump, against SciPy's SuperLU.

A dome of 161 x 161 vertices under known light, with noise of one display value. Prints how far normals
are from the true ones near the bump (smooth mesh, relief), CPU seconds of the relief of a frame and of
the combination of normals and positions (Nehab 2005), each with our factorisation and with SuperLU in
its place, the ratios of these, and the peak memory of the process.

With `--actors`: studio actors whose skin folds with the expression, or is folded in all frames
(`benchmarks/wrinkled_actor.py`), rendered (three seconds a frame) and refined from the mesh without folds: mean
angle of normals to the true ones in the folds and on all of the skin, smooth and with relief. `before` is the
light of the first frames alone, nothing hidden from it, on a mesh that is divided once.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import product

import numpy as np
from scipy.sparse.linalg import splu

from benchmarks.common import peak_gb, print_table, timed
from benchmarks.relief_on_actor import ReliefOnActor
from benchmarks.wrinkled_actor import WrinkledActor
from tests.unit import test_relief as scenes
from vermilion.config.detail import ReliefConfig
from vermilion.detail.relief import combine, high_pass, relief
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.geometry.mesh import triangle_normals, vertex_normals

SIDE = 161
#: As relief was before all frames told of its light.
BEFORE = ReliefConfig(levels=1, spacing_mm=0.01, curvature_sigma=0.03)


class SuperLU:
    """SciPy's factorisation behind the interface of ours."""

    def __init__(self, matrix):
        self.solve = splu(matrix.tocsc()).solve


@contextmanager
def factorising_with(factor: type) -> Iterator[None]:
    """Put another factorisation in place of ours."""
    ours = relief.CholeskyFactor
    try:
        for module in (relief, high_pass, combine):
            module.CholeskyFactor = factor
        yield
    finally:
        for module in (relief, high_pass, combine):
            module.CholeskyFactor = ours


def actors(
    seeds: Sequence[int], lights: Sequence[str], n_frames: int
) -> Iterator[dict[str, float | str]]:
    """A row for each actor, light, kind of folds, and relief as before and now."""
    for seed, name, standing in product(seeds, lights, (0.0, 0.8)):
        actor = WrinkledActor(seed, name, standing, n_frames)
        for first_only in (True, False):
            take = ReliefOnActor(actor, BEFORE if first_only else ReliefConfig(), first_only)
            yield {
                "actor": str(seed),
                "light": name,
                "folds": "standing" if standing else "moving",
                "relief": "before" if first_only else "now",
                **take.errors_deg(),
            }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which actors."""
    parser.add_argument(
        "--actors", type=int, nargs="*", default=[], metavar="SEED", help="actors to render"
    )
    parser.add_argument(
        "--lights", nargs="*", default=["room"], metavar="NAME", help="studio lights (%(default)s)"
    )
    parser.add_argument(
        "--frames", type=int, default=34, metavar="N", help="frames of a take (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    if arguments.actors:
        print_table(list(actors(arguments.actors, arguments.lights, arguments.frames)))
        return
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
    rows = []
    for name, factor in (("ours (cholespy)", relief.CholeskyFactor), ("SuperLU", SuperLU)):
        with factorising_with(factor):
            solve = timed(
                partial(
                    relief.solve_relief, points, scenes.FACING, observed, light, topology, settings
                ),
                warm_up=True,
            )
            after = vertex_normals(points + solve.result[:, None] * normals, topology.skin)
            join = timed(
                partial(
                    combine.combine_positions_and_normals,
                    points,
                    normals,
                    after,
                    topology,
                    0.1,
                    solve.result,
                ),
                warm_up=True,
            )
        rows.append({"factor": name, "relief s": solve.cpu_s, "combination s": join.cpu_s})
    for row in rows:
        for part in ("relief", "combination"):
            row[f"{part} ratio"] = row[f"{part} s"] / rows[-1][f"{part} s"]
    print_table(rows)
    before_deg = scenes.degrees_apart(normals, true)[near].mean()
    after_deg = scenes.degrees_apart(after, true)[near].mean()
    print(f"normals: smooth {before_deg:.2f} degrees off, with relief {after_deg:.2f}")
    print(f"peak memory {peak_gb():.2f} GB")
