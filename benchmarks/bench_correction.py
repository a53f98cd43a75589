"""Speed of the correction on one core: features to corrected vertices, against the bare solves.

    OMP_NUM_THREADS=1 python -m benchmarks.bench_correction

A mesh of 40,000 vertices, a mask of about 20,000 triangles, an RBF network of 329 prototypes on 53
features (the size of Lips16). Prints milliseconds a frame, best of several runs, for:

- the whole: features -> layers -> right-hand sides -> solve -> vertices (`Corrector.correct`);
- its parts;
- the triangular solves of the same system alone, same number of frames together;
- the peer: the gradients decoded by NumPy, the right-hand side by a sparse product, SciPy's SuperLU
  solving the same system.

Bars: 15 ms a frame, and 2.5 times the bare solves.
"""

from __future__ import annotations

import time

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from vermilion.correction.apply import BLOCK, Corrector
from vermilion.correction.layers import decode_layers
from vermilion.correspondence.correspondence import topology_hash
from vermilion.regression.estimators import RBFNetwork
from vermilion.regression.model import LipModel

N_FRAMES = 64


def sheet(n: int = 200, size_mm: float = 250.0) -> tuple[np.ndarray, np.ndarray]:
    """A curved sheet of n * n vertices with irregular triangles."""
    axis = np.linspace(-size_mm / 2, size_mm / 2, n)
    x, y = np.meshgrid(axis, axis)
    rng = np.random.default_rng(0)
    flat = np.stack([x, y], axis=-1).reshape(-1, 2)
    flat = flat + rng.normal(scale=0.15 * size_mm / n, size=flat.shape)
    vertices = np.column_stack([flat, 30 * np.cos(flat[:, 0] / 60) * np.cos(flat[:, 1] / 60)])
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i in (0, 1) for j in (0, 1))
    return vertices, np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def fitted_model(triangles: np.ndarray, mask: np.ndarray) -> LipModel:
    """A network of the paper's size with small layers."""
    rng = np.random.default_rng(1)
    features = rng.normal(size=(3289, 53))
    network = RBFNetwork(0.1, 0.1, 10)
    # Fitting 180,000 outputs would only make numbers: the weights are drawn instead.
    network.fit(features, np.zeros((3289, 1), dtype=np.float32))
    n_outputs = 9 * len(mask)
    network.weights_ = (0.01 * rng.normal(size=(329, n_outputs))).astype(np.float32)
    network.bias_ = np.zeros(n_outputs, dtype=np.float32)
    return LipModel(
        name="bench",
        estimator=network,
        feature_names=tuple(f"shape_{k}" for k in range(53)),
        feature_columns=np.arange(53),
        mask=mask,
        topology=topology_hash(triangles),
        training_frames={},
    )


def best_ms(action, repeats: int = 5, frames: int = N_FRAMES) -> float:
    """Milliseconds a frame of the fastest of several runs, after one to warm up."""
    action()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times) / frames


def peer(corrector: Corrector, coarse: np.ndarray, features: np.ndarray, mask_triangles):
    """The same maths with NumPy and SciPy alone, as a function to time."""
    integrator = corrector.integrator
    lu = splu(integrator.matrix)
    n_triangles = len(mask_triangles)
    position = np.full(coarse.shape[1], -1)
    position[integrator.free] = np.arange(len(integrator.free))
    rows, columns, data = [], [], []
    for k in range(3):
        for corner, sign in ((1, -1.0), (2, 1.0)):
            vertex = position[mask_triangles[:, (k + corner) % 3]]
            keep = vertex >= 0
            rows.append(vertex[keep])
            columns.append((np.arange(n_triangles) * 3 + k)[keep])
            data.append(sign * integrator.weights[keep, k])
    shape = (len(integrator.free), 3 * n_triangles)
    divergence = sparse.csr_matrix(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))), shape=shape
    )

    def run():
        corrected = coarse.copy()
        layers = corrector.model.predict(features)
        for f in range(len(coarse)):
            change = decode_layers(layers[f]) - np.eye(3)
            corners = coarse[f, mask_triangles]
            edges = np.stack(
                [corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3] for k in range(3)], axis=1
            )
            wanted = np.einsum("tij,tkj->tki", change, edges).reshape(-1, 3)
            corrected[f, integrator.free] += lu.solve(divergence @ wanted)
        return corrected

    return run


def main() -> None:
    vertices, triangles = sheet()
    radius = np.linalg.norm(vertices[:, :2], axis=1)
    mask = np.flatnonzero((radius < 70.5)[triangles].all(axis=1))
    start = time.perf_counter()
    corrector = Corrector(fitted_model(triangles, mask), vertices, triangles)
    integrator = corrector.integrator
    print(f"mesh {len(vertices)} vertices, mask {len(mask)} triangles, {len(integrator.free)} free")
    print(f"model and factor                {time.perf_counter() - start:8.2f} s, once")
    rng = np.random.default_rng(2)
    coarse = vertices + np.sin(vertices / 20 + rng.uniform(0, 6, size=(N_FRAMES, 1, 3)))
    features = rng.normal(size=(N_FRAMES, 53))
    block, few = features[:BLOCK], coarse[:BLOCK]
    layers = corrector.model.predict_frames_last(block)
    right = integrator.right_side(few, layers).reshape(len(integrator.free), -1)
    whole = best_ms(lambda: corrector.correct(coarse, features))
    solves = best_ms(lambda: integrator.factor.solve(right), frames=BLOCK)
    predict = best_ms(lambda: corrector.model.predict_frames_last(block), frames=BLOCK)
    sides = best_ms(lambda: integrator.right_side(few, layers), frames=BLOCK)
    other = peer(corrector, coarse[:8], features[:8], triangles[mask])
    difference = np.abs(other() - corrector.correct(coarse[:8], features[:8])).max()
    numpy_ms = best_ms(other, repeats=2, frames=8)
    print(f"features to vertices            {whole:8.2f} ms a frame (bar 15)")
    print(f"  layers from features          {predict:8.2f}")
    print(f"  right-hand sides              {sides:8.2f}")
    print(f"bare solves of the same system  {solves:8.2f}, {BLOCK} frames together")
    print(f"whole over bare solves          {whole / solves:8.2f} (bar 2.5)")
    print(f"peer (NumPy, SciPy SuperLU)     {numpy_ms:8.2f} ms a frame, {difference:.1e} mm apart")


if __name__ == "__main__":
    main()
