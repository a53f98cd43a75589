"""The coarse track C of a finished run against the truth, step by step; speed of its refinement.

    OMP_NUM_THREADS=1 python -m benchmarks.bench_tracking results/sample \
        --take p1/phone --truth ../shared/data/capture-sample-truth [--face-vertices 9409]

Distance as in Mono13 section 9: the first frame is aligned rigidly (iterated closest points), then
in each frame the mean translation in depth is discarded, and each visible vertex of the face is
compared with the nearest visible vertex of the truth. Mono13 reports 1.71 mm. `surface` is the
distance to the true surface. Depth jitter is the mean second difference over time of the face's mean
depth less the truth's. Residuals are those of `tracking/residuals/` (display values, 0 to 255).

Speed, where an image source is given (`--source`): seconds a frame of this core's time (what else
runs does not count) of the photometric step and of the corrective layer, and their ratio to the
landmark fit of the same frames.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from vermilion.appearance.estimate import Appearance
from vermilion.config.tracking import TrackingConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import rigid_alignment, vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem
from vermilion.tracking.image_fit.take import TakeStart
from vermilion.tracking.landmark_fit.expression import fit_motion
from vermilion.tracking.landmark_fit.observation import focal_px
from vermilion.tracking.offsets import OffsetSettings, OffsetSolver
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import landmark_fit_settings

_ROUNDS = 60


def seen(camera: Camera, vertices: np.ndarray, triangles: np.ndarray, keep: np.ndarray):
    """Ids of the vertices of `keep` that face the camera and are not hidden."""
    rays = vertices - camera.centre_mm
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    facing = (vertex_normals(vertices, triangles) * rays).sum(axis=1) < -0.1
    ids = np.flatnonzero(keep & facing)
    return ids[RayCaster(vertices, triangles).visible(camera, vertices[ids], 0.5)]


def first_alignment(source: np.ndarray, target: cKDTree) -> tuple[np.ndarray, np.ndarray]:
    """Rigid motion of points (N, 3) onto a cloud by iterated closest points, 5 % left out."""
    rotation, translation = np.eye(3), np.zeros(3)
    for _ in range(_ROUNDS):
        moved = source @ rotation.T + translation
        distance, nearest = target.query(moved)
        near = distance <= np.quantile(distance, 0.95)
        rotation, translation = rigid_alignment(source[near], target.data[nearest[near]])
    return rotation, translation


def distances(model, meshes, camera, truth, truth_triangles, truth_face) -> dict[str, float]:
    """Means over frames and visible vertices, mm."""
    face = model.regions["face"] & ~model.regions["mouth_inner"]
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    axis, motion, rows = camera.rotation[2], None, []
    for mesh, true in zip(meshes.astype(float), truth.astype(float), strict=True):
        ids = seen(camera, mesh, model.triangles, face)
        target = cKDTree(true[seen(camera, true, truth_triangles, truth_face)])
        first = motion is None
        if first:
            motion = first_alignment(mesh[ids], target)
        points = mesh[ids] @ motion[0].T + motion[1]
        for _ in range(0 if first else 10):
            nearest = target.data[target.query(points)[1]]
            points = points + ((nearest - points) @ axis).mean() * axis
        distance = target.query(points)[0]
        normals = vertex_normals(mesh, model.triangles)[ids] @ motion[0].T
        surface = Surface(true, truth_triangles).closest(points, normals, 0.0).distance_mm
        rows.append(
            [
                distance.mean(), distance.max(), surface[np.isfinite(surface)].mean(),
                distance[lips[ids]].mean(),
            ]
        )  # fmt: skip
    depth = (meshes[:, face] @ axis).mean(axis=1) - (truth[:, truth_face] @ axis).mean(axis=1)
    names = ("vertex_mm", "largest_mm", "surface_mm", "lips_mm")
    jitter = np.abs(np.diff(depth, n=2)).mean()
    return dict(zip(names, np.mean(rows, axis=0), strict=True)) | {"depth_jitter_mm": jitter}


def steps_of(folder: Path, model: FaceModel, person: Identity):
    """(name, meshes (F, V, 3)) of each step that the run has, in order."""
    fit = TrackedTake.load(folder / "fit.npz")
    every = np.arange(len(fit.frames))
    landmark_fit = folder / "landmark_fit.npz"
    if landmark_fit.exists():
        yield "landmarks", TrackedTake.load(landmark_fit).vertices_mm(model, person, every)
        yield "photometric", fit.vertices_mm(model, person, every)
    else:
        yield "landmarks", fit.vertices_mm(model, person, every)
    if (folder / "offsets").is_dir():
        yield "layer", np.asarray(read_sequence(sorted(folder.glob("C/*.npy"))))


def residual_of(folder: Path, step: str) -> tuple[float, float]:
    """Mean residual of all frames, and of those the appearance was not learnt from."""
    paths = sorted((folder / "residuals" / step).glob("*.tsv"))
    rows = [row for path in paths for row in read_table(path).itertuples()]
    values = np.array([row.residual for row in rows], dtype=float)
    fresh = np.array([row.learnt_from == 0 for row in rows], dtype=bool)
    means = [np.nanmean(v) if len(v) else np.nan for v in (values, values[fresh])]
    return means[0], means[1]


def speed(folder: Path, model: FaceModel, person: Identity, source: str, fps: float, count: int):
    """Print seconds a frame of the steps, and their ratio to the landmark fit."""
    path = folder / "landmark_fit.npz"
    fit = TrackedTake.load(path if path.exists() else folder / "fit.npz")
    track = LandmarkTrack.load(sorted((folder.parent / "landmarks").glob("*.npz")))
    options = TrackingConfig().model_dump(mode="json")
    settings = landmark_fit_settings(options["fit"], options["motion"])
    start = TakeStart.of(model, person, fit, track, settings)
    appearance = Appearance.load(folder / "appearance.npz")
    face = start.face(appearance.samples)
    photometric = FrameFitSettings(**options["image_fit"]["frame_fit"])
    problem = FrameProblem(face, appearance, photometric, settings.weight_sigma)
    bending = OffsetSettings(**{k: v for k, v in options["offsets"].items() if k != "enabled"})
    layer = OffsetSolver(model, person.neutral_mm, face, appearance, bending)
    frames, levels = open_frames(source), len(photometric.iterations)
    rows = np.unique(np.linspace(0, len(fit.frames) - 1, count).round().astype(int))
    began = time.process_time()
    fit_motion(start.landmark_shape(), start.seen, focal_px(fit.camera), fps, settings)
    base = (time.process_time() - began) / len(fit.frames)
    spent = np.zeros(3)
    for row in rows:
        marks = [time.process_time()]
        image = frames.read(fit.camera.name, int(fit.frames[row]))
        view = start.view(row, image, face, options["image_fit"]["appearance"]["pixel_mm"], levels)
        marks.append(time.process_time())
        problem.solve(view)
        marks.append(time.process_time())
        layer.solve(view)
        marks.append(time.process_time())
        spent += np.diff(marks)
    reading, solving, bending_s = spent / len(rows)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"landmark fit {1e3 * base:.1f} ms a frame; the steps, reading the image included:")
    for name, cost in (("photometric", reading + solving), ("layer", reading + bending_s)):
        print(f"  {name:12} {cost:.3f} s a frame, {cost / base:.0f} x the landmark fit")
    print(f"peak memory {peak:.2f} GB (bars: 0.3 s, 2 GB)")


def main() -> None:
    """Print the table of a take, and speed where asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder of a finished run")
    parser.add_argument("--take", default="p1/phone", help="subject/take")
    parser.add_argument("--truth", type=Path, help="folder of the truth (evaluation.truth)")
    parser.add_argument("--face-vertices", type=int, default=9409, help="of the truth: the face")
    parser.add_argument("--source", help="images of the take, to measure speed")
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--count", type=int, default=12, help="frames that speed is measured on")
    args = parser.parse_args()
    folder = args.results / "takes" / args.take / "tracking"
    subject = args.take.split("/")[0]
    own = args.results / "subjects" / subject / "tracker.npz"
    model = FaceModel.load(own if own.exists() else args.results / "face" / "tracker.npz")
    person = Identity.load(args.results / "subjects" / subject / "identity.npz")
    fit = TrackedTake.load(folder / "fit.npz")
    if args.truth:
        truth = np.load(args.truth / args.take / "vertices_mm.npy")[fit.frames - fit.frames[0]]
        triangles = np.load(args.truth / args.take / "triangles.npy")
        face = np.arange(truth.shape[1]) < args.face_vertices
    for step, meshes in steps_of(folder, model, person):
        figures = dict(zip(("residual", "held_out"), residual_of(folder, step), strict=True))
        if args.truth:
            figures |= distances(model, meshes, fit.camera, truth, triangles, face)
        print(f"{step:12}", "  ".join(f"{name} {value:.3f}" for name, value in figures.items()))
    if args.source:
        speed(folder, model, person, args.source, args.fps, args.count)


if __name__ == "__main__":
    main()
