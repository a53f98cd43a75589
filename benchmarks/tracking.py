"""The coarse track C of a finished run against the truth, step by step; speed of the image fit.

Distance as in Mono13 section 9: the first frame is aligned rigidly (iterated closest points), then
in each frame the mean translation in depth is discarded, and each visible vertex of the face is
compared with the nearest visible vertex of the truth. Mono13 reports 1.71 mm. `surface` is the
distance to the true surface. Depth jitter is the mean second difference over time of the face's mean
depth less the truth's. Residuals are those of `tracking/residuals/` (display values, 0 to 255).
Without truth there are residuals alone.

With `--speed`: core seconds a frame of the image fit and of the offsets, reading the image included,
and their ratio to the landmark fit of the same frames. Bars: 0.3 s, 2 GB.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.common import add_run_arguments, peak_gb, print_table, timed
from benchmarks.finished_run import FinishedRun
from vermilion.appearance.estimate import Appearance
from vermilion.config.tracking import TrackingConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import Similarity, similarity_alignment
from vermilion.geometry.camera import Camera
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.tables import read_table
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem
from vermilion.tracking.image_fit.take import DenseLips, TakeStart
from vermilion.tracking.landmark_fit.expression import fit_motion
from vermilion.tracking.landmark_fit.observation import focal_px
from vermilion.tracking.offsets import OffsetSettings, OffsetSolver
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import landmark_fit_settings

_ROUNDS = 60


@dataclass(frozen=True)
class Truth:
    """True meshes of the take's frames, (F, V', 3) mm, their triangles (T', 3), and which vertices
    (V',) are of the face."""

    vertices_mm: np.ndarray
    triangles: np.ndarray
    face: np.ndarray

    @classmethod
    def of(cls, run: FinishedRun, frames: np.ndarray, face_vertices: int) -> Truth:
        """The truth of the `frames` (F,) of a track; the first vertices are those of the face."""
        vertices = run.true_mm()[frames - frames[0]]
        return cls(vertices, run.true_triangles(), np.arange(vertices.shape[1]) < face_vertices)


def seen(
    camera: Camera, vertices: np.ndarray, triangles: np.ndarray, keep: np.ndarray
) -> np.ndarray:
    """Ids (n,) of the vertices of `keep` (V,) that face the camera and are not hidden.

    `vertices` (V, 3) in the world, mm; `triangles` (T, 3).
    """
    rays = vertices - camera.centre_mm
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    facing = (vertex_normals(vertices, triangles) * rays).sum(axis=1) < -0.1
    ids = np.flatnonzero(keep & facing)
    return ids[RayCaster(vertices, triangles).visible(camera, vertices[ids], 0.5)]


def first_alignment(source: np.ndarray, target: cKDTree) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and translation (3,) of `source` (N, 3) onto a cloud: iterated closest points,
    the farthest 5 % left out."""
    found = Similarity(1.0, np.eye(3), np.zeros(3))
    for _ in range(_ROUNDS):
        distance, nearest = target.query(found.apply(source))
        near = distance <= np.quantile(distance, 0.95)
        found = similarity_alignment(source[near], target.data[nearest[near]], scale=1.0)
    return found.rotation, found.translation


def distances(
    model: FaceModel, meshes: np.ndarray, camera: Camera, truth: Truth
) -> dict[str, float]:
    """Means over frames and visible vertices of `meshes` (F, V, 3), mm."""
    face = model.regions["face"] & ~model.regions["mouth_inner"]
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    axis, motion, rows = camera.rotation[2], None, []
    for mesh, true in zip(meshes.astype(float), truth.vertices_mm.astype(float), strict=True):
        ids = seen(camera, mesh, model.triangles, face)
        target = cKDTree(true[seen(camera, true, truth.triangles, truth.face)])
        first = motion is None
        if first:
            motion = first_alignment(mesh[ids], target)
        points = mesh[ids] @ motion[0].T + motion[1]
        for _ in range(0 if first else 10):
            nearest = target.data[target.query(points)[1]]
            points = points + ((nearest - points) @ axis).mean() * axis
        distance = target.query(points)[0]
        normals = vertex_normals(mesh, model.triangles)[ids] @ motion[0].T
        surface = Surface(true, truth.triangles).closest(points, normals, 0.0).distance_mm
        rows.append(
            [
                distance.mean(), distance.max(), surface[np.isfinite(surface)].mean(),
                distance[lips[ids]].mean(),
            ]
        )  # fmt: skip
    true_depth = (truth.vertices_mm[:, truth.face] @ axis).mean(axis=1)
    depth = (meshes[:, face] @ axis).mean(axis=1) - true_depth
    names = ("vertex_mm", "largest_mm", "surface_mm", "lips_mm")
    jitter = np.abs(np.diff(depth, n=2)).mean()
    return dict(zip(names, np.mean(rows, axis=0), strict=True)) | {"depth_jitter_mm": jitter}


def landmark_fit(run: FinishedRun) -> TrackedTake:
    """The track before the image fit."""
    path = run.folder / "tracking" / "landmark_fit.npz"
    return TrackedTake.load(path) if path.exists() else run.fit()


def steps_of(
    run: FinishedRun, model: FaceModel, person: Identity
) -> Iterator[tuple[str, np.ndarray]]:
    """Name and meshes (F, V, 3) of each step that the run has, in order."""
    fit, folder = run.fit(), run.folder / "tracking"
    every = np.arange(len(fit.frames))
    yield "landmarks", landmark_fit(run).vertices_mm(model, person, every)
    if (folder / "landmark_fit.npz").exists():
        yield "photometric", fit.vertices_mm(model, person, every)
    if (folder / "offsets").is_dir():
        yield "layer", run.coarse_mm()


def residual_of(folder: Path, step: str) -> tuple[float, float]:
    """Mean residual of all frames, and of those the appearance was not learnt from."""
    paths = sorted((folder / "residuals" / step).glob("*.tsv"))
    rows = [row for path in paths for row in read_table(path).itertuples()]
    values = np.array([row.residual for row in rows], dtype=float)
    fresh = np.array([row.learnt_from == 0 for row in rows], dtype=bool)
    means = [np.nanmean(v) if len(v) else np.nan for v in (values, values[fresh])]
    return means[0], means[1]


def speed(run: FinishedRun, model: FaceModel, person: Identity, fps: float, count: int) -> None:
    """Print core seconds a frame of the steps on `count` frames, and their ratio to the landmark fit."""
    fit, images = landmark_fit(run), run.images()
    options = TrackingConfig().model_dump(mode="json")
    settings = landmark_fit_settings(options["fit"], options["motion"])
    lips = DenseLips(**options["image_fit"]["lips"])
    start = TakeStart.of(model, person, fit, run.landmarks(), settings, lips=lips)
    appearance = Appearance.load(run.folder / "tracking" / "appearance.npz")
    face = start.face(appearance.samples)
    photometric = FrameFitSettings(**options["image_fit"]["frame_fit"])
    pixel_mm, levels = options["image_fit"]["appearance"]["pixel_mm"], len(photometric.iterations)
    problem = FrameProblem(face, appearance, photometric, start.weight_sigmas)
    bending = OffsetSettings(**{k: v for k, v in options["offsets"].items() if k != "enabled"})
    layer = OffsetSolver(model, person.neutral_mm, face, appearance, bending)

    def view_of(row: int):
        image = images.read(fit.camera.name, int(fit.frames[row]))
        return start.view(row, image, face, pixel_mm, levels)

    shape, focal = start.landmark_shape(), focal_px(fit.camera)
    base_s = timed(lambda: fit_motion(shape, start.seen, focal, fps, settings)).cpu_s
    base_s /= len(fit.frames)
    spent = []
    for row in evenly_spaced(len(fit.frames), count):
        view = timed(partial(view_of, row))
        steps = [timed(partial(solver.solve, view.result)) for solver in (problem, layer)]
        spent.append([view.cpu_s + step.cpu_s for step in steps])
    costs = dict(zip(("photometric", "layer"), np.mean(spent, axis=0), strict=True))
    rows = [
        {"step": name, "core s a frame": cost, "x landmark fit": cost / base_s}
        for name, cost in ({"landmarks": base_s} | costs).items()
    ]
    print_table(rows, {"core s a frame": 3, "x landmark fit": 0})
    print(f"peak memory {peak_gb():.2f} GB")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read, and how it is measured."""
    add_run_arguments(parser)
    parser.add_argument(
        "--face-vertices", type=int, default=9409, help="of the truth: the face (%(default)s)"
    )
    parser.add_argument("--speed", action="store_true", help="time the steps on the take's images")
    parser.add_argument("--fps", type=float, default=30.0, help="of the take (%(default)s)")
    parser.add_argument(
        "--count", type=int, default=12, help="frames that speed is measured on (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    take = FinishedRun.of(arguments)
    model, person, fit = take.tracker_model(), take.identity(), take.fit()
    truth = None
    if (take.truth / "vertices_mm.npy").is_file():
        truth = Truth.of(take, fit.frames, arguments.face_vertices)
    elif arguments.truth:
        raise InputError(
            "no vertices_mm.npy", "true meshes of the take", "Correct --truth.", path=take.truth
        )
    rows = []
    for step, meshes in steps_of(take, model, person):
        residuals = residual_of(take.folder / "tracking", step)
        row = {"step": step} | dict(zip(("residual", "held_out"), residuals, strict=True))
        if truth is not None:
            row |= distances(model, meshes, fit.camera, truth)
        rows.append(row)
    print_table(rows, 3)
    if arguments.speed:
        speed(take, model, person, arguments.fps, arguments.count)
