"""Speed of the correction on one core: features to corrected vertices, against the bare solves.

A mesh of 40,000 vertices, a mask of about 20,000 triangles, 53 features, 3,289 training frames (the
size of Lips16). Two regressors, the RBF network of 329 prototypes and the kernel regressor on all
frames, whose predictions have the principal components of `SPECTRA`. For each, milliseconds a frame of
this core's time (what else runs on the machine does not count), the least of several rounds in which
the parts take turns, for:

- the whole: features -> layers -> right-hand sides -> solve -> vertices (`Corrector.correct_heads`);
- its parts;
- the triangular solves of the same system alone, same number of frames together;
- the peer: the gradients decoded by NumPy, the right-hand side by a sparse product, SciPy's SuperLU
  solving the same system.

Bars: 15 ms a frame, and 2.5 times the bare solves. `--basis-error 0` leaves no layer out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from vermilion.config.correction import CorrectionConfig
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, Corrector
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.layers import decode_layers
from vermilion.correction.right_side import LANES, TURN_SERIES, accumulate_mixture, turn_limits
from vermilion.faces.contours import closed_loop, edge_graph
from vermilion.faces.model import REGIONS, FaceModel
from vermilion.features.rings import lip_rings
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.mesh import mesh_corners, topology_hash
from vermilion.regression.estimators import RBFNetwork
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.linear import layer_basis
from vermilion.regression.model import LipModel

N_FRAMES = 64
#: (component, its deviation of the first) of what regressors of four simulated people predict.
SPECTRA = {
    "rbf": {0: 1.0, 1: 0.61, 2: 0.47, 4: 0.28, 8: 0.17, 16: 0.074, 32: 0.021, 48: 0.0024, 64: 2e-4},
    "kernel": {
        0: 1.0, 1: 0.64, 2: 0.51, 4: 0.33, 8: 0.19, 16: 0.11, 32: 0.051, 48: 0.029, 64: 0.017,
        96: 0.0053, 128: 0.0015, 200: 1.4e-4,
    },
}  # fmt: skip


def sheet(n: int = 200, size_mm: float = 250.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n * n, 3) mm and irregular triangles (T, 3) of a curved sheet."""
    axis = np.linspace(-size_mm / 2, size_mm / 2, n)
    x, y = np.meshgrid(axis, axis)
    rng = np.random.default_rng(0)
    flat = np.stack([x, y], axis=-1).reshape(-1, 2)
    flat = flat + rng.normal(scale=0.15 * size_mm / n, size=flat.shape)
    vertices = np.column_stack([flat, 30 * np.cos(flat[:, 0] / 60) * np.cos(flat[:, 1] / 60)])
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i in (0, 1) for j in (0, 1))
    return vertices, np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def fitted_model(
    kind: str, triangles: np.ndarray, mask: np.ndarray, basis_error: float
) -> LipModel:
    """A regressor of the paper's size with small layers on `triangles` (T, 3), `mask` (M,) of them."""
    rng = np.random.default_rng(1)
    features = rng.normal(size=(3289, 53))
    estimator = RBFNetwork(0.1, 0.1, 10) if kind == "rbf" else KernelRegressor(0.1, 0.1)
    # Fitting 180,000 outputs would only make numbers: the weights are drawn instead, so that the
    # predictions for the training frames have the spectrum.
    estimator.fit(features, np.zeros((3289, 1), dtype=np.float32))
    design = estimator.activations(features)
    directions = np.linalg.svd(design - design.mean(axis=0), full_matrices=False)[2]
    stretch = np.linalg.norm((design - design.mean(axis=0)) @ directions.T, axis=0)
    places, values = zip(*SPECTRA[kind].items(), strict=True)
    count = min(len(stretch), places[-1])
    deviations = np.exp(np.interp(np.arange(count), places, np.log(values)))
    corners = mesh_corners(triangles, mask)
    n_outputs = 9 * len(mask) + 3 * len(corners)
    weights = directions[:count].T * (0.05 * np.sqrt(len(features)) * deviations / stretch[:count])
    weights = weights.astype(np.float32) @ rng.standard_normal((count, n_outputs), dtype=np.float32)
    estimator.coefficients_, estimator.basis_ = layer_basis(design, weights, 0.1, basis_error)
    estimator.bias_ = np.zeros(n_outputs, dtype=np.float32)
    return LipModel(
        name="bench",
        estimator=estimator,
        feature_names=tuple(f"shape_{k}" for k in range(53)),
        feature_columns=np.arange(53),
        mask=mask,
        topology=topology_hash(triangles),
        vertices=corners,
        training_frames={},
    )


def best_ms(actions: dict[str, tuple[Callable, int]], rounds: int = 15) -> dict[str, float]:
    """Milliseconds a frame of the fastest of several rounds; each action has its frames."""
    best = dict.fromkeys(actions, np.inf)
    for round_ in range(rounds + 1):
        for name, (action, frames) in actions.items():
            start = time.thread_time()
            action()
            if round_:  # the first warms up
                best[name] = min(best[name], 1e3 * (time.thread_time() - start) / frames)
    return best


def peer(corrector: Corrector, coarse: np.ndarray, features: np.ndarray, triangles: np.ndarray):
    """The same maths with NumPy and SciPy alone on eight frames, as a function to time.

    `coarse` (F, V, 3) mm, `features` (F, 53), `triangles` (T, 3) of the mesh.
    """
    integrator, coarse, features = corrector.integrator, coarse[:8], features[:8]
    mask_triangles = triangles[corrector.model.mask]
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


def settings_of(detail_mm: float) -> CorrectionSettings:
    """Without the image and without a filter over time."""
    return CorrectionSettings(16.0, detail_mm, smooth_frames=0, fade_power=0.0, image=None)


def take_of(
    vertices: np.ndarray, triangles: np.ndarray, coarse: np.ndarray, features: np.ndarray
) -> CoarseTake:
    """Heads that stand still at the origin of the world.

    `vertices` (V, 3) and `coarse` (F, V, 3) in mm, `triangles` (T, 3), `features` (F, 53).
    """
    n = len(coarse)
    pose = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    valid = np.ones(n, dtype=bool)
    return CoarseTake(np.arange(n), coarse, triangles, vertices, *pose, features, valid)


def report(kind: str, corrector: Corrector, take: CoarseTake) -> None:
    """Print the figures of one regressor."""
    model, integrator = corrector.model, corrector.integrator
    coarse, features, frames = take.coarse_mm, take.features, take.frames
    right = np.random.default_rng(3).normal(size=(len(integrator.free), 3 * LANES))
    ms = best_ms(
        {
            "whole": (lambda: corrector.correct_heads(coarse, features, frames), N_FRAMES),
            "solves": (lambda: integrator.factor.solve(right), LANES),
            "mixture": (lambda: model.mixture(features), N_FRAMES),
            "sides": (right_sides(corrector), LANES),
            "copy": (lambda: np.array(coarse), N_FRAMES),
        }
    )
    shape = model.estimator.coefficients_.shape
    print(f"\n{kind}: {shape[0]} activations, a basis of {shape[1]} layers")
    print(f"features to vertices            {ms['whole']:8.2f} ms a frame (bar 15)")
    print(f"  mixture from features         {ms['mixture']:8.2f}")
    print(f"  layers and right-hand sides   {ms['sides']:8.2f}")
    print(f"  copy of the vertices          {ms['copy']:8.2f}")
    print(f"bare solves of the same system  {ms['solves']:8.2f}, {LANES} frames together")
    print(f"whole over bare solves          {ms['whole'] / ms['solves']:8.2f} (bar 2.5)")


def mouth_on(vertices: np.ndarray, triangles: np.ndarray) -> FaceModel:
    """A closed mouth drawn on the sheet: contours, lips and eyes where a face has them.

    `vertices` (V, 3) mm and `triangles` (T, 3) are those of the sheet.
    """
    graph = edge_graph(vertices, triangles)
    x, y = vertices[:, 0], vertices[:, 1]

    def nearest(points: np.ndarray) -> np.ndarray:
        return cKDTree(vertices[:, :2]).query(points)[1]

    angle = np.pi - np.linspace(0, 2 * np.pi, 24, endpoint=False)
    loops = [
        closed_loop(graph, nearest(np.stack([26 * np.cos(angle), h * np.sin(angle)], axis=1)))
        for h in (11.0, 2.5)
    ]
    landmarks = nearest(np.random.default_rng(4).uniform(-60, 60, (66, 2)))
    landmarks[[58, 62, 36, 45]] = nearest(np.array([[-26, 0], [26, 0], [-44, 70], [44, 70]]))
    regions = {name: np.zeros(len(vertices), dtype=bool) for name in REGIONS}
    lips = (x / 26) ** 2 + (y / 11) ** 2 < 1
    regions["vermilion_upper"], regions["vermilion_lower"] = lips & (y > 0), lips & (y <= 0)
    nothing = np.zeros((0, len(vertices), 3), np.float32)
    uv = np.zeros((len(vertices), 2), np.float32)
    return FaceModel(
        "sheet", vertices, triangles, (), nothing, nothing, uv, landmarks, *loops, regions
    )


def report_image(model: LipModel, take: CoarseTake, settings: CorrectionSettings) -> None:
    """Print the figures of the correction with pose, contours and contact."""
    face = mouth_on(take.neutral_mm, take.triangles)
    camera = pinhole(
        "cam",
        1500.0,
        1280,
        720,
        look_at(np.array([0, 0, 700.0]), np.zeros(3), np.array([0, 1.0, 0])),
    )
    rng = np.random.default_rng(5)
    found = [
        camera.project(ring.points(take.coarse_mm)) + rng.normal(scale=0.5, size=(N_FRAMES, 80, 2))
        for ring in lip_rings(face, 80)
    ]
    known = np.ones((N_FRAMES, 80), dtype=bool)
    take = replace(take, image=ImageContours(face, camera, *found, known, known))
    settings = replace(settings, image=CorrectionSettings.of(CorrectionConfig().at(30.0)).image)
    with_image = Corrector(model, take, settings)
    without = Corrector(model, take, replace(settings, image=None))
    ms = best_ms(
        {
            "whole": (lambda: with_image.correct(take), N_FRAMES),
            "base": (lambda: without.correct(take), N_FRAMES),
        },
        rounds=4,
    )
    print("\nwith the image: pose, 160 contour points, contact (nothing touches)")
    print(f"features to vertices            {ms['whole']:8.2f} ms a frame (bar 15)")
    print(f"  without the image             {ms['base']:8.2f}")


def right_sides(corrector: Corrector) -> Callable:
    """The compiled part alone, on a block of frames."""
    integrator, basis = corrector.integrator, corrector._basis
    points = np.zeros((len(integrator._local), 3, LANES), dtype=basis.dtype)
    right = np.zeros((len(integrator.free) + 1, 3, LANES))
    lanes = np.ones((basis.shape[1], LANES), dtype=basis.dtype)
    series = TURN_SERIES[basis.dtype], turn_limits(basis.dtype)
    triangles = integrator._triangles(points)
    return lambda: accumulate_mixture(*triangles, basis, lanes, *series, right)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """How far the basis of layers is cut."""
    parser.add_argument(
        "--basis-error", type=float, default=0.03, help="training.basis_error (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    vertices, triangles = sheet()
    radius = np.linalg.norm(vertices[:, :2], axis=1)
    mask = np.flatnonzero((radius < 71.6)[triangles].all(axis=1))
    rng = np.random.default_rng(2)
    coarse = vertices + np.sin(vertices / 20 + rng.uniform(0, 6, size=(N_FRAMES, 1, 3)))
    features = rng.normal(size=(N_FRAMES, 53))
    print(f"mesh {len(vertices)} vertices, mask {len(mask)} triangles")
    for kind in SPECTRA:
        model = fitted_model(kind, triangles, mask, arguments.basis_error)
        take, settings = take_of(vertices, triangles, coarse, features), settings_of(10.0)
        report(kind, Corrector(model, take, settings), take)
    report_image(model, take, settings)
    corrector = Corrector(model, take, settings_of(0.0))  # the peer knows no displacements
    other = peer(corrector, coarse, features, triangles)
    difference = np.abs(other() - corrector.correct(take[:8])).max()
    numpy_ms = best_ms({"peer": (other, 8)}, rounds=2)["peer"]
    print(f"peer (NumPy, SciPy SuperLU)     {numpy_ms:8.2f} ms a frame, {difference:.1e} mm apart")
