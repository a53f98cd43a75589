"""Guided lip correction: speed beside the obvious way, and error against the number of frames.

    OMP_NUM_THREADS=1 python -m benchmarks.bench_guided [speed] [study] [sizes] \
        [--ict ../shared/data/ict-facekit/FaceXModel.tar.xz] \
        [--curves ../shared/data/performance/rom.csv] [--actors 4] [--draws 20]

`speed`: training (k = 11, m = 19,315 triangles), a frame, and a sketch solve on a mesh of 40,000
vertices, in this core's time (what else runs does not count), each beside the obvious way in the same
run. Bars: 50 ms, 15 ms, 0.5 s.

`study`: actors whose expressions are their own (each shape with a gain, a direction and a smooth field
of its own, and fields of pairs of shapes, which no sum of shapes gives), 276 recorded frames, 0.03 mm
of noise. Some frames train, all others are predicted; share of the inner lips' deformation from the
neutral that is left (mean distance over the free vertices of the inner lips, head frame). Bars: 10
suggested frames 15 %, 10 uniform 22 %, 5 suggested 30 %, and 5 suggested reach the median of 10 random.
`gradients` is figure 11's mean of |x* - x|. Also lips that pass through each other and the volumes of
the lips.

`sizes`: what other sizes of the inner lips and the mouth region cost.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from vermilion.correction.integration import cotangents, edge_stiffness
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, look_at, pinhole
from vermilion.geometry.deformation_gradients import deformation_gradients
from vermilion.geometry.mesh import rigid_alignment
from vermilion.geometry.sparse import CholeskyFactor
from vermilion.guided.contact import LipVolumes
from vermilion.guided.dirichlet import _divergence
from vermilion.guided.gradients import NeutralTriangles
from vermilion.guided.propagation import LipPropagator
from vermilion.guided.refinement import RefinementSettings, SketchRefiner, View
from vermilion.guided.regions import GuidedRegions, regions_of_face, regions_of_triangles
from vermilion.guided.silhouette import LipSurface
from vermilion.guided.sketch import Sketch, SketchCurve
from vermilion.guided.suggestion import (
    extreme_frames,
    mouth_deformation,
    random_frames,
    suggest_frames,
    uniform_frames,
)
from vermilion.studio.live_link import read_live_link
from vermilion.studio.performance import generated_weights

N_FRAMES, NOISE_MM = 276, 0.03
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
    motions = [rigid_alignment(mesh[stable], vertices[stable]) for mesh in train]
    aligned = np.stack([m @ r.T + t for m, (r, t) in zip(train, motions, strict=True)])
    y, x = (
        deformation_gradients(vertices, aligned, part).reshape(len(train), -1).T for part in parts
    )
    (u_y, s_y, v_y), (u_x, s_x, v_x) = (np.linalg.svd(m, full_matrices=False) for m in (y, x))
    c_y, c_x = s_y[:, None] * v_y, s_x[:, None] * v_x
    return u_y, u_x @ (c_x @ c_y.T @ np.linalg.inv(c_y @ c_y.T))


def plain_frame(vertices, regions: GuidedRegions, model, frame: np.ndarray) -> np.ndarray:
    """A frame with NumPy and SuperLU, the system assembled and factored for it."""
    stable = np.unique(regions.triangles[regions.trusted])
    rotation, translation = rigid_alignment(frame[0, stable], vertices[stable])
    mesh = frame[0] @ rotation.T + translation
    y = deformation_gradients(vertices, mesh, regions.triangles[regions.trusted]).ravel()
    x = (model[1] @ (model[0].T @ y)).reshape(-1, 3, 3)
    inside = regions.triangles[regions.predicted]
    weights = cotangents(vertices, inside)
    stiffness = edge_stiffness(inside, weights, len(vertices))[regions.free]
    right = _divergence(vertices, inside, weights)[regions.free] @ x.transpose(0, 2, 1).reshape(
        -1, 3
    )
    right -= stiffness[:, regions.border] @ mesh[regions.border]
    mesh[regions.free] = splu(stiffness[:, regions.free].tocsc()).solve(right)
    result = frame.copy()
    result[0, regions.free] = (mesh[regions.free] - translation) @ rotation
    return result


def sketch_speed() -> None:
    """A sketch solve on a head of 40,000 vertices, and the same with a system factored each time."""
    from vermilion.faces.procedural import studio_model

    face = studio_model(0.54, 2, None)
    regions = regions_of_face(face)
    surface = LipSurface.of_face(face, regions)
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
    from scipy import sparse

    from vermilion.guided.refinement import _keeping_matrix

    settings = refiner.settings
    position = np.full(len(base), settings.position)
    position[regions.followers] = settings.still
    keeping = _keeping_matrix(regions, refiner.movable, position, settings.regularity)
    row = np.full(len(base), -1)
    row[refiner.movable] = np.arange(len(refiner.movable))
    ready, current = View.of(sketch, view, settings), base.copy()
    for _ in range(settings.iterations):
        rows = refiner._view_rows(current, ready)
        at = row[rows.vertices]
        values = np.where(at < 0, 0.0, rows.coefficients)[..., None] * rows.directions[:, None]
        columns = 3 * np.maximum(at, 0)[..., None] + np.arange(3)
        count = len(rows)
        jacobian = sparse.csr_matrix(
            (values.ravel(), (np.repeat(np.arange(count), values[0].size), columns.ravel())),
            shape=(count, 3 * len(refiner.movable)),
        )
        weight = sparse.diags_array(1.0 / rows.compliance)
        system = sparse.kron(keeping, sparse.eye_array(3)) + jacobian.T @ weight @ jacobian
        right = jacobian.T @ (rows.wanted / rows.compliance)
        solved = CholeskyFactor(system).solve(right).reshape(-1, 3)
        current[refiner.movable] += solved
    return current


def camera_of(face: FaceModel, mouth_px: float = 120.0) -> Camera:
    """A camera 600 mm in front of the mouth, whose corners are `mouth_px` apart."""
    loop = face.neutral_mm[face.inner_contour]
    centre = loop.mean(axis=0)
    pose = look_at(centre + np.array([0.0, 0.0, 600.0]), centre, np.array([0.0, 1.0, 0.0]))
    return pinhole("cam", 600.0 * mouth_px / np.ptp(loop[:, 0]), 640, 640, pose)


def sketch_of(vertices: np.ndarray, surface: LipSurface, view: Camera) -> Sketch:
    """Both inner contours of an open mouth: the outermost silhouette in every other column."""
    flat = {
        n: SketchCurve(np.array([[0.0, 0.0], [1.0, 0.0]])) for n in ("upper_inner", "lower_inner")
    }
    ready = View.of(Sketch("cam", 0, (640, 640), flat), view, RefinementSettings())
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


def actor_take(face: FaceModel, weights: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(neutral (V, 3), meshes (F, V, 3)) mm of an actor whose expressions are the actor's own.

    Args:
        weights: (F, K) expression weights.
    """
    rng = np.random.default_rng([seed, 1600])
    identity = 0.7 * np.clip(rng.standard_normal(face.n_identities), -2, 2)
    neutral = face.neutral_of(identity)
    shapes = face.expressions_mm.astype(np.float64)
    for shape in shapes:
        turn = Rotation.from_rotvec(np.radians(6) * rng.normal(size=3)).as_matrix()
        reach = np.linalg.norm(shape, axis=1, keepdims=True)
        own = 0.35 * reach * smooth_field(neutral, rng)
        shape[:] = rng.uniform(0.75, 1.25) * shape @ turn.T + own
    take = neutral + np.tensordot(weights, shapes, axes=(1, 0))
    mouth = [i for i, n in enumerate(face.expression_names) if n.startswith(("mouth", "jaw"))]
    busiest = sorted(mouth, key=lambda i: -weights[:, i].std())[:10]
    size = np.linalg.norm(shapes, axis=2)
    for number, i in enumerate(busiest):
        for j in busiest[:number]:
            reach = np.sqrt(size[i] * size[j])[:, None]
            pair = 0.25 * reach * smooth_field(neutral, rng)
            take += (weights[:, i] * weights[:, j])[:, None, None] * pair
    take += NOISE_MM * rng.standard_normal(take.shape)
    return neutral, take


def smooth_field(points: np.ndarray, rng, length_mm: float = 12.0, waves: int = 40) -> np.ndarray:
    """Random vectors (V, 3) of unit variance that change over `length_mm`."""
    direction = rng.normal(size=(waves, 3)) / length_mm
    phase, size = rng.uniform(0, 2 * np.pi, waves), rng.normal(size=(waves, 3))
    return np.cos(points @ direction.T + phase) @ size / np.sqrt(waves / 2)


class Trial:
    """One actor's take: propagation from any chosen frames, and what it leaves."""

    def __init__(self, face: FaceModel, weights: np.ndarray, seed: int, **sizes: float):
        self.face = face
        self.neutral, self.take = actor_take(face, weights, seed)
        self.regions = regions_of_face(face, **sizes)
        self.stable = np.flatnonzero(face.regions["rigid"])
        self.propagator = LipPropagator(self.neutral, self.regions, self.stable)
        self.deformation = mouth_deformation(self.take, self.neutral, self.regions, self.stable)
        free = self.regions.free
        self.size = np.linalg.norm(self.take[:, free] - self.neutral[free], axis=2).mean(axis=1)

    def left(self, frames: np.ndarray, **options) -> tuple[float, float, np.ndarray]:
        """(share left of the deformation, mean |x* - x|, meshes) of all frames but those trained."""
        self.propagator.fit(self.take[frames], **options)
        found = self.propagator.correct(self.take).vertices_mm
        free, others = self.regions.free, np.setdiff1d(np.arange(len(self.take)), frames)
        error = np.linalg.norm(found[:, free] - self.take[:, free], axis=2).mean(axis=1)
        share = error[others].mean() / self.size[others].mean()
        inside = NeutralTriangles(self.neutral, self.regions.triangles[self.regions.predicted])
        gradient = np.linalg.norm(
            inside.gradients(found[others]) - inside.gradients(self.take[others]), axis=1
        )
        return share, gradient.mean(), found


def study(face: FaceModel, takes: dict[str, np.ndarray], actors: int, draws: int) -> None:
    """Print the table of shares left against the choice of frames, and the checks of the lips."""
    print("\nshare of the inner lips' deformation left (%), mean over the frames not trained")
    print(f"{'take':12s} {'actor':>5s} {'mm':>5s} | suggested 5, 10 | uniform 5, 10 | extremes 10 "
          "| random 5, 10 (median) | without the neutral: suggested 5, 10")  # fmt: skip
    held = []
    for name, weights in takes.items():
        for actor in range(actors):
            trial = Trial(face, weights, actor)
            suggested = {k: suggest_frames(trial.deformation, k) for k in (5, 10)}
            uniform = {k: uniform_frames(len(weights), k) for k in (5, 10)}
            extreme = extreme_frames(trial.deformation, 10)
            share = [
                100 * trial.left(f)[0] for f in (*suggested.values(), *uniform.values(), extreme)
            ]
            chance = [
                100
                * np.median(
                    [trial.left(random_frames(len(weights), k, d))[0] for d in range(draws)]
                )
                for k in (5, 10)
            ]
            plain = [100 * trial.left(f, with_neutral=False)[0] for f in suggested.values()]
            held.append((*share, *chance))
            print(
                f"{name:12s} {actor:5d} {trial.size.mean():5.2f} | {share[0]:6.1f} {share[1]:6.1f}   |"
                f" {share[2]:5.1f} {share[3]:6.1f}  | {share[4]:8.1f}    | {chance[0]:8.1f}"
                f" {chance[1]:6.1f}       | {plain[0]:12.1f} {plain[1]:6.1f}",
                flush=True,
            )
    held = np.array(held)
    print(f"worst: 10 suggested {held[:, 1].max():.1f} (bar 15), 10 uniform {held[:, 3].max():.1f} "
          f"(bar 22), 5 suggested {held[:, 0].max():.1f} (bar 30); 5 suggested over the median of "
          f"10 random: mean {(held[:, 0] / held[:, 6]).mean():.2f}, worst "
          f"{(held[:, 0] / held[:, 6]).max():.2f} (bar 1)")  # fmt: skip
    lips(face, next(iter(takes.values())))


def lips(face: FaceModel, weights: np.ndarray) -> None:
    """Figure 11's curve, contact and volumes of one actor, by the number of suggested frames."""
    trial = Trial(face, weights, 0)
    crossings, volumes = LipCrossings(face), LipVolumes.of(face)
    rest = volumes.measure(trial.neutral[None])
    true = volumes.measure(trial.take) / rest
    print("\n  k  left (%)  gradients  volumes off (% of the lip, mean, worst frame)")
    for k in (1, 2, 3, 5, 8, 10, 15, 20):
        share, gradient, found = trial.left(suggest_frames(trial.deformation, k))
        off = 100 * np.abs(volumes.measure(found) / rest - true).max(axis=1)
        print(f"{k:3d} {100 * share:8.1f} {gradient:10.2f} {off.mean():10.2f} {off.max():6.2f}")
    frames = suggest_frames(trial.deformation, 10)
    trial.propagator.fit(trial.take[frames])
    every = np.arange(0, len(trial.take), 3)
    for label, lip in (("truth", None), ("propagated", None), ("and parted", crossings)):
        meshes = trial.take[every]
        if label != "truth":
            meshes = trial.propagator.correct(meshes, lip).vertices_mm
        depth = np.array([crossings.find(mesh).deepest_mm for mesh in meshes])
        off = 100 * np.abs(volumes.measure(meshes) / rest - true[every]).max(axis=1)
        print(f"lips through each other, {label:11s} {(depth > 0.05).sum():3d} of {len(depth)} frames, "
              f"deepest {depth.max():.2f} mm; volumes off {off.mean():.2f} %, {off.max():.2f} at worst")  # fmt: skip


def sizes(face: FaceModel, weights: np.ndarray) -> None:
    """Print what other sizes of the regions cost, 10 suggested frames."""
    print("\n inner inside mouth (mm)  predicted  trusted  deformation (mm)  left (%)  left (mm)")
    for inner, inside, mouth in (
        (3, 8, 40), (5, 8, 40), (8, 8, 40), (12, 8, 40), (5, 4, 40), (5, 12, 40),
        (5, 8, 15), (5, 8, 25), (5, 8, 60),
    ):  # fmt: skip
        trial = Trial(face, weights, 0, inner_mm=inner, inside_mm=inside, mouth_mm=mouth)
        share = trial.left(suggest_frames(trial.deformation, 10))[0]
        print(f"{inner:6d} {inside:6d} {mouth:5d} {len(trial.regions.predicted):15d} "
              f"{len(trial.regions.trusted):8d} {trial.size.mean():17.2f} {100 * share:9.1f} "
              f"{share * trial.size.mean():9.2f}", flush=True)  # fmt: skip


def the_face(archive: str | None) -> FaceModel:
    if archive and Path(archive).exists():
        from vermilion.faces import ict
        from vermilion.faces.ict_archive import read_ict

        return ict.studio_model(read_ict(archive, 100), 100)
    from vermilion.faces.procedural import studio_model

    return studio_model(seed=0)


def the_takes(face: FaceModel, curves: str | None) -> dict[str, np.ndarray]:
    """Recorded weights, a busy stretch and the whole take thinned out, or generated ones."""
    names = face.expression_names
    if curves and Path(curves).exists():
        return {
            "rom, whole": read_live_link(curves, names, N_FRAMES, 30.0, 60, 30.0 * 14),
            "rom, 2240": read_live_link(curves, names, N_FRAMES, 30.0, 2240, 30.0),
            "rom, 3500": read_live_link(curves, names, N_FRAMES, 30.0, 3500, 30.0),
        }
    return {"generated": generated_weights(names, N_FRAMES, 30.0, seed=7)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("parts", nargs="*", default=["speed", "study", "sizes"])
    parser.add_argument("--ict", default="../shared/data/ict-facekit/FaceXModel.tar.xz")
    parser.add_argument("--curves", default="../shared/data/performance/rom.csv")
    parser.add_argument("--actors", type=int, default=4)
    parser.add_argument("--draws", type=int, default=20)
    arguments = parser.parse_args()
    if "speed" in arguments.parts:
        speed()
    if {"study", "sizes"} & set(arguments.parts):
        face = the_face(arguments.ict)
        takes = the_takes(face, arguments.curves)
        print(f"\nface model {face.name}, {face.n_vertices} vertices, {N_FRAMES} frames")
        if "study" in arguments.parts:
            study(face, takes, arguments.actors, arguments.draws)
        if "sizes" in arguments.parts:
            sizes(face, next(iter(takes.values())))


if __name__ == "__main__":
    main()
