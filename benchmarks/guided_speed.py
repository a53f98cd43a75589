"""Speed of guided correction, each part beside the obvious way in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from benchmarks.guided_actors import smooth_field
from vermilion.faces.model import FaceModel
from vermilion.faces.procedural import studio_model
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.camera import Camera, look_at, pinhole
from vermilion.geometry.cotangents import cotangents, edge_stiffness
from vermilion.geometry.deformation_gradients import deformation_gradients
from vermilion.geometry.sparse import CholeskyFactor
from vermilion.guided.dirichlet import gradient_divergence
from vermilion.guided.propagation import LipPropagator
from vermilion.guided.refinement import (
    RefinementSettings,
    SketchRefiner,
    SketchView,
    keeping_matrix,
)
from vermilion.guided.regions import GuidedRegions, regions_of_face, regions_of_triangles
from vermilion.guided.silhouette import ContourSurface
from vermilion.guided.sketch import Sketch, SketchCurve

N_TRUSTED, N_PREDICTED, N_TRAINING = 19_315, 6_000, 11


def sheet(n: int = 200, size_mm: float = 250.0) -> tuple[np.ndarray, np.ndarray]:
    """A curved sheet of n * n vertices with irregular triangles."""
    axis = np.linspace(-size_mm / 2, size_mm / 2, n)
    flat = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    flat = flat + np.random.default_rng(0).normal(scale=0.15 * size_mm / n, size=flat.shape)
    vertices = np.column_stack([flat, 30 * np.cos(flat[:, 0] / 60) * np.cos(flat[:, 1] / 60)])
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i in (0, 1) for j in (0, 1))
    return vertices, np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def best_ms(action: Callable, rounds: int) -> float:
    """Milliseconds of this thread, the fastest of several rounds; the first warms up."""
    times = []
    for _ in range(rounds + 1):
        start = time.thread_time()
        action()
        times.append(1e3 * (time.thread_time() - start))
    return min(times[1:])


def speed() -> None:
    """Print the table of speeds."""
    vertices, triangles = sheet()
    order = np.argsort(np.linalg.norm(vertices[triangles].mean(axis=1)[:, :2], axis=1))
    regions = regions_of_triangles(
        triangles, len(vertices), order[:N_PREDICTED], order[N_PREDICTED:][:N_TRUSTED]
    )
    rng = np.random.default_rng(1)
    frames = range(N_TRAINING + 1)
    take = np.stack([vertices + 1.5 * smooth_field(vertices, rng, 25.0) for _ in frames])
    propagator = LipPropagator(vertices, regions)
    train, frame = take[:N_TRAINING], take[N_TRAINING:]
    print(f"mesh {len(vertices)} vertices, m {len(regions.trusted)}, n {len(regions.predicted)}")
    ours = best_ms(lambda: propagator.fit(train, with_neutral=False), 7)
    peer = best_ms(lambda: plain_training(vertices, regions, train), 2)
    gigabytes = 81 * 8 * len(regions.trusted) * len(regions.predicted) / 1e9
    print(f"training, k = {N_TRAINING}, meshes to model   {ours:9.1f} ms (bar 50)")
    print(f"  NumPy gradients, LAPACK SVDs        {peer:9.1f}")
    print(f"  dense theta: {gigabytes:.0f} GB, not tried")
    model = plain_training(vertices, regions, train)
    difference = np.abs(
        plain_frame(vertices, regions, model, frame) - propagator.correct(frame).vertices_mm
    ).max()
    ours = best_ms(lambda: propagator.correct(frame), 15)
    peer = best_ms(lambda: plain_frame(vertices, regions, model, frame), 2)
    print(f"a frame, mesh to mesh                 {ours:9.1f} ms (bar 15)")
    print(f"  NumPy, system factored each frame   {peer:9.1f}, {difference:.0e} mm apart")
    sketch_speed()


def plain_training(vertices: np.ndarray, regions: GuidedRegions, train: np.ndarray):
    """Section 4 written down with NumPy alone."""
    parts = [regions.triangles[ids] for ids in (regions.trusted, regions.predicted)]
    stable = np.unique(parts[0])
    motions = [similarity_alignment(mesh[stable], vertices[stable], scale=1.0) for mesh in train]
    aligned = np.stack([to.apply(m) for m, to in zip(train, motions, strict=True)])
    y, x = (
        deformation_gradients(vertices, aligned, part).reshape(len(train), -1).T for part in parts
    )
    (u_y, s_y, v_y), (u_x, s_x, v_x) = (np.linalg.svd(m, full_matrices=False) for m in (y, x))
    c_y, c_x = s_y[:, None] * v_y, s_x[:, None] * v_x
    return u_y, u_x @ (c_x @ c_y.T @ np.linalg.inv(c_y @ c_y.T))


def plain_frame(vertices, regions: GuidedRegions, model, frame: np.ndarray) -> np.ndarray:
    """A frame with NumPy and SuperLU, the system assembled and factored for it."""
    stable = np.unique(regions.triangles[regions.trusted])
    motion = similarity_alignment(frame[0, stable], vertices[stable], scale=1.0)
    mesh = motion.apply(frame[0])
    y = deformation_gradients(vertices, mesh, regions.triangles[regions.trusted]).ravel()
    x = (model[1] @ (model[0].T @ y)).reshape(-1, 3, 3)
    inside = regions.triangles[regions.predicted]
    weights = cotangents(vertices, inside)
    stiffness = edge_stiffness(inside, weights, len(vertices))[regions.free]
    right = gradient_divergence(vertices, inside, weights)[regions.free] @ x.transpose(
        0, 2, 1
    ).reshape(-1, 3)
    right -= stiffness[:, regions.border] @ mesh[regions.border]
    mesh[regions.free] = splu(stiffness[:, regions.free].tocsc()).solve(right)
    result = frame.copy()
    result[0, regions.free] = (mesh[regions.free] - motion.translation) @ motion.rotation
    return result


def sketch_speed() -> None:
    """A sketch solve on a head of 40,000 vertices, and the same with a system factored each time."""
    face = studio_model(0.54, 2, None)
    regions = regions_of_face(face)
    surface = ContourSurface.of_face(face, regions)
    index = [face.expression_names.index(n) for n in ("jawOpen", "mouthFunnel", "mouthSmile_L")]
    weights = np.zeros((2, face.n_expressions))
    weights[:, index] = [[0.3, 0.0, 0.0], [0.3, 0.4, 0.4]]
    base, true = face.vertices(None, weights)
    view = camera_of(face)
    sketch = sketch_of(true, surface, view)
    refiners = []

    def prepare():
        refiners.append(SketchRefiner(regions, surface))

    prepare_ms = best_ms(prepare, 1)
    start = time.thread_time()
    result = refiners[-1].refine(base, [(sketch, view)])
    first_ms = 1e3 * (time.thread_time() - start)
    next_ms = best_ms(lambda: refiners[-1].refine(base, [(sketch, view)]), 3)
    distances = np.concatenate(list(result.distance_px["cam"].values()))
    print(
        f"\nhead {face.n_vertices} vertices, {len(refiners[-1].movable)} may move, mouth of 120 px"
    )
    print(f"preparing a topology                  {prepare_ms:9.1f} ms")
    print(f"first sketch solve                    {first_ms:9.1f} ms (bar 500)")
    print(f"further sketch solves                 {next_ms:9.1f}")
    print(f"  contour off the sketch, mean, max   {distances.mean():9.2f} {distances.max():.2f} px")
    start = time.thread_time()
    other = refactored(refiners[-1], regions, surface, base, sketch, view)
    peer_ms = 1e3 * (time.thread_time() - start)
    apart = np.abs(other - result.vertices_mm).max()
    print(f"  system of 3N factored each time     {peer_ms:9.1f}, {apart:.0e} mm apart")


def refactored(refiner: SketchRefiner, regions, surface, base, sketch, view) -> np.ndarray:
    """Five iterations of eq. 1, each a sparse system of all coordinates that is factored anew."""
    settings = refiner.settings
    position = np.full(len(base), settings.position)
    position[regions.followers] = settings.still
    keeping = keeping_matrix(regions, refiner.movable, position, settings.regularity)
    row = np.full(len(base), -1)
    row[refiner.movable] = np.arange(len(refiner.movable))
    ready, current = SketchView.of(sketch, view, settings), base.copy()
    for _ in range(settings.iterations):
        made = refiner._view_constraints(current, ready)
        at = row[made.vertices]
        values = np.where(at < 0, 0.0, made.coefficients)[..., None] * made.directions[:, None]
        columns = 3 * np.maximum(at, 0)[..., None] + np.arange(3)
        count = len(made)
        jacobian = sparse.csr_matrix(
            (values.ravel(), (np.repeat(np.arange(count), values[0].size), columns.ravel())),
            shape=(count, 3 * len(refiner.movable)),
        )
        weight = sparse.diags_array(1.0 / made.compliance)
        system = sparse.kron(keeping, sparse.eye_array(3)) + jacobian.T @ weight @ jacobian
        right = jacobian.T @ (made.target_mm / made.compliance)
        solved = CholeskyFactor(system).solve(right).reshape(-1, 3)
        current[refiner.movable] += solved
    return current


def camera_of(face: FaceModel, mouth_px: float = 120.0) -> Camera:
    """A camera 600 mm in front of the mouth, whose corners are `mouth_px` apart."""
    loop = face.neutral_mm[face.inner_contour]
    centre = loop.mean(axis=0)
    pose = look_at(centre + np.array([0.0, 0.0, 600.0]), centre, np.array([0.0, 1.0, 0.0]))
    return pinhole("cam", 600.0 * mouth_px / np.ptp(loop[:, 0]), 640, 640, pose)


def sketch_of(vertices: np.ndarray, surface: ContourSurface, view: Camera) -> Sketch:
    """Both inner contours of an open mouth: the outermost silhouette in every other column."""
    flat = {
        n: SketchCurve(np.array([[0.0, 0.0], [1.0, 0.0]])) for n in ("upper_inner", "lower_inner")
    }
    ready = SketchView.of(Sketch("cam", 0, (640, 640), flat), view, RefinementSettings())
    strokes = {}
    for name, segments in ready.contours(vertices, surface).items():
        share = np.linspace(0.0, 1.0, 9)[:, None, None]
        points = (segments.start_px * (1 - share) + segments.end_px * share).reshape(-1, 2)
        column = np.round(points[:, 0] / 2)
        sign = 1.0 if name == "upper_inner" else -1.0
        order = np.lexsort((-sign * points[:, 1], column))
        _, first = np.unique(column[order], return_index=True)
        strokes[name] = points[order[first]]
    # As far as the mouth is open: beyond its corners, folds of the skin have silhouettes as well.
    upper, lower = strokes["upper_inner"], strokes["lower_inner"]
    open_ = lower[:, 1] > np.interp(lower[:, 0], upper[:, 0], upper[:, 1])
    middle = len(lower) // 2
    shut = np.flatnonzero(~open_)
    first = lower[shut[shut < middle].max(initial=-1) + 1, 0]
    last = lower[shut[shut > middle].min(initial=len(lower)) - 1, 0]
    curves = {
        name: SketchCurve(s[(s[:, 0] >= first) & (s[:, 0] <= last)]) for name, s in strokes.items()
    }
    return Sketch("cam", 0, (640, 640), curves)
