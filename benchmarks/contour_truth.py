"""Accuracy of the contour detectors against true contours, by kind of mouth shape.

The true outer contour is the visible border of the vermilion, the true inner one that of the opening,
as the camera sees the true mesh (`vertices_mm.npy` in the vertex order of the studio's model). Contours
are searched for from **C** of the run, in the head frame, as the workflow does, or from the landmarks'
curves where the take is not yet tracked, in the maps of

- `boosted`: boosted edge learning, trained anew on the take's labelled frames, as `auto` does, and
  measured on the others; before the take is tracked its labels count as drawn;
- `track`: the tracked lips moved to the border of the lips' colour, learnt from the take;
- `landmarks`: the landmarks' curves moved there.

Prints, for each and for each kind of mouth shape, the mean distance between found and true contour in
pixels at a mouth width of 120 px, the 95th percentile over frames, and the share of failures: frames
whose contour is over 3 px away, or of which less than 60 % was found.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from benchmarks.common import add_run_arguments, print_table, timed
from benchmarks.contours import FoundContours, search_from_landmarks
from benchmarks.finished_run import FinishedRun
from vermilion.config.contours import ContourDetectorConfig
from vermilion.contours.detector import ContourDetector
from vermilion.contours.labels import label_paths, read_contour_label
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_from_take
from vermilion.contours.training import ContourTrainingSettings, LabelledFrame, train_detector
from vermilion.evaluation.contour_error import distance_to_polyline
from vermilion.faces.model import FaceModel
from vermilion.features.contour_features import ContourSampler
from vermilion.features.search import SearchSettings
from vermilion.features.tracked_lips import TrackedLips
from vermilion.geometry.camera import Camera
from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_taken
from vermilion.studio.labels import lip_contours
from vermilion.studio.surface import surface_of
from vermilion.tracking.result import TrackedTake

#: Outer and inner ring of the tracked lips in an image, (n, 2) px each.
Rings = tuple[np.ndarray, np.ndarray]
WIDTH_PX, FAILED_PX, LEAST_FOUND = 120.0, 3.0, 0.6


@dataclass(frozen=True)
class Coarse:
    """The tracker's model, poses and meshes (F, V, 3), world frame, mm."""

    model: FaceModel
    fit: TrackedTake
    meshes_mm: np.ndarray


@dataclass(frozen=True)
class Scene:
    """A take, its true contours, the kind of mouth shape (F,), and its track where it has one."""

    camera: Camera
    images: FrameSource
    track: LandmarkTrack
    loops: list[dict[str, np.ndarray]]
    kinds: np.ndarray
    labels: dict[int, LabelledFrame]
    coarse: Coarse | None

    @classmethod
    def of(cls, run: FinishedRun) -> Scene:
        """Read everything of a take."""
        (camera,) = run.cameras().values()
        images, track = run.images(), run.landmarks()
        loops = true_contours(run.model("studio"), run.true_mm(), camera)
        labels = {
            f: LabelledFrame(
                images.read(camera.name, f), track.points_px[f], read_contour_label(path), f
            )
            for f, path in label_paths(run.capture, camera.name).items()
        }
        coarse = None
        if (run.folder / "tracking" / "C").is_dir():
            coarse = Coarse(run.tracker_model(), run.fit(), run.coarse_mm())
        return cls(camera, images, track, loops, kinds_of(loops), labels, coarse)

    def rings_px(self) -> dict[int, Rings]:
        """The tracked lips in each frame's image; none without a track."""
        if self.coarse is None:
            return {}
        lips = TrackedLips.of(self.coarse.model)
        return {f: lips.rings_px(mesh, self.camera) for f, mesh in enumerate(self.coarse.meshes_mm)}


def true_contours(
    studio: FaceModel, truth_mm: np.ndarray, camera: Camera
) -> list[dict[str, np.ndarray]]:
    """Outer and inner contour (n, 2) px of every frame of `truth_mm` (F, V', 3)."""
    surface, n = surface_of(studio), truth_mm.shape[1]
    kept = (studio.triangles < n).all(axis=1)  # the sample capture's truth has no teeth
    model = replace(studio, triangles=studio.triangles[kept])
    surface = replace(
        surface,
        material=surface.material[kept],
        lip_mm=surface.lip_mm[:n],
        inside_mm=surface.inside_mm[:n],
        upper=surface.upper[:n],
    )
    return [lip_contours(model, surface, frame.astype(np.float64), camera) for frame in truth_mm]


def kinds_of(loops: list[dict[str, np.ndarray]]) -> np.ndarray:
    """(F,) `closed`, `rounded` or `open`, by `loops`, true contours (n, 2) px of each frame."""
    width = np.array([np.ptp(loop["outer"][:, 0]) for loop in loops])
    opening = np.array([np.ptp(loop["inner"][:, 1]) for loop in loops]) / np.median(width)
    opening -= opening.min()  # the corners of a closed mouth lie lower than its middle
    return np.where(
        width < 0.85 * np.median(width), "rounded", np.where(opening < 0.06, "closed", "open")
    )


def distances(
    found: FoundContours, loops: dict[str, np.ndarray], width_px: float
) -> dict[str, float]:
    """Mean distance of a frame's found contours and the true `loops` (n, 2) at the standard width.

    From the found points to the true line or from the true points to the found one, whichever is
    larger: a contour that runs along the other lip is near the true line everywhere.
    """
    scale = WIDTH_PX / width_px
    inner = loops["inner"]
    across = (found.inner_px[:, 0] > inner[:, 0].min()) & (found.inner_px[:, 0] < inner[:, 0].max())
    result = {}
    for name, points, line in (
        ("outer", found.outer_px, loops["outer"]),
        ("inner", found.inner_px[across], inner),
    ):
        ring = getattr(found, f"{name}_px")
        to_true = distance_to_polyline(points, line, True).mean()
        to_found = distance_to_polyline(line, ring, True).mean()
        result[f"{name}_px"] = float(max(to_true, to_found) * scale)
    return result


def finder(scene: Scene) -> Callable:
    """A function (frame, maps) -> contours."""
    if scene.coarse is not None:
        fit, meshes = scene.coarse.fit, scene.coarse.meshes_mm
        sampler = ContourSampler.of(scene.coarse.model, 80, SearchSettings())
        turns, places = fit.world_from_head_rotation, fit.world_from_head_translation_mm
        return lambda f, maps: sampler.find(meshes[f], scene.camera, maps, (turns[f], places[f]))
    points_px = scene.track.points_px
    return lambda f, maps: search_from_landmarks(maps, points_px[f])


def detectors_of(scene: Scene, rings: dict[int, Rings]) -> dict[str, ContourDetector]:
    """The detectors, each learnt from what the take has."""
    # Curves of 66 landmarks, as the workflow takes them: rendered lips have no shade of their own.
    detectors: dict[str, ContourDetector] = {"landmarks": LandmarkRidgeDetector(lips_shade=0.0)}
    labelled = list(scene.labels.values())
    if scene.coarse is not None:
        cfg = ContourDetectorConfig()
        near_track = learn_from_take(
            TrackRidgeDetector(),
            sorted(evenly_taken(np.flatnonzero(scene.track.valid).tolist(), cfg.track.frames)),
            lambda frame: scene.images.read(scene.camera.name, frame),
            scene.track.points_px.__getitem__,
            rings.__getitem__,
            cfg.track.reach,
        )
        if near_track is not None:
            detectors["track"] = near_track
    if labelled:
        detectors["boosted"] = train_detector(labelled, ContourTrainingSettings())
    return detectors


def measure(scene: Scene, every: int = 1) -> pd.DataFrame:
    """A row a detector and frame without a label.

    Raises:
        InputError: each frame has one.
    """
    find, rings = finder(scene), scene.rings_px()
    detectors = detectors_of(scene, rings)
    width_px = float(np.median([np.ptp(loop["outer"][:, 0]) for loop in scene.loops]))
    rows = []
    for frame in range(0, len(scene.loops), every):
        if frame in scene.labels:
            continue
        valid, points = scene.track.valid[frame], scene.track.points_px[frame]
        image = scene.images.read(scene.camera.name, frame) if valid else None
        for name, detector in detectors.items():
            row = {"detector": name, "frame": frame, "kind": scene.kinds[frame], "failed": True}
            if image is not None:
                maps = timed(partial(detector.likelihood, image, points, rings.get(frame)))
                row["maps_cpu_s"] = maps.cpu_s
                found = find(frame, maps.result)
                row |= distances(found, scene.loops[frame], width_px)
                enough = min(found.outer_found.mean(), found.inner_found.mean()) >= LEAST_FOUND
                near = max(row["outer_px"], row["inner_px"]) <= FAILED_PX
                row["failed"] = not (near and enough)
            rows.append(row)
    if not rows:
        raise InputError(
            f"a label on each of every {every} frames", "frames without a label", "Lower --every."
        )
    return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """A row a detector and kind."""
    whole = table.assign(kind="all")
    groups = pd.concat([table, whole]).groupby(["detector", "kind"])
    return groups.agg(
        frames=("frame", "count"),
        outer_px=("outer_px", "mean"),
        outer_p95_px=("outer_px", lambda v: v.quantile(0.95)),
        inner_px=("inner_px", "mean"),
        inner_p95_px=("inner_px", lambda v: v.quantile(0.95)),
        failed=("failed", "mean"),
        maps_cpu_s=("maps_cpu_s", "median"),
    ).reset_index()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read, and how it is measured."""
    add_run_arguments(parser)
    parser.add_argument(
        "--every", type=int, default=1, help="measure each such frame (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    print_table(summary(measure(Scene.of(FinishedRun.of(arguments)), arguments.every)))
