"""Accuracy of both contour detectors against true contours, by kind of mouth.

    python -m benchmarks.bench_contour_truth RESULTS SUBJECT/TAKE CAPTURE TRUTH [every]

RESULTS is the folder of a run, CAPTURE the take's capture folder, TRUTH its truth (`vertices_mm.npy`
in the studio model's vertex order, as the studio and the sample capture have it). The true outer
contour is the visible border of the vermilion, the true inner one that of the opening, as the camera
sees the true mesh. Contours are looked for from **C** of the run, in the head frame, as the workflow
does, or from the landmarks' curves where the take is not yet tracked, in the maps of

- `boosted`: boosted edge learning, trained anew on the take's labelled frames, as `auto` does, and
  measured on the others; before the take is tracked its labels count as drawn;
- `track`: the tracked lips moved to the border of the lips' colour, learnt from the take;
- `landmarks`: the landmarks' curves moved there.

Prints, for each and for each kind of mouth, the mean distance between found and true contour in
pixels at a mouth width of 120 px, the 95th percentile over frames, and the share of failures: frames
whose contour is over 3 px away, or of which less than 60 % was found.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.config.contours import ContourDetectorConfig
from vermilion.contours.curves import loop_spline
from vermilion.contours.label_offset import without_lean
from vermilion.contours.labels import label_paths, read_label
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.maps import evenly
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_from_take
from vermilion.contours.training import LabelledFrame, TrainingSettings, train_detector
from vermilion.evaluation.contour_error import distance_to_polyline
from vermilion.faces.model import FaceModel
from vermilion.features.contour_features import ContourSampler
from vermilion.features.search import SearchSettings, find_inner, find_outer
from vermilion.features.tracked_lips import TrackedLips
from vermilion.geometry.camera import read_cameras
from vermilion.imaging.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import LIP_INNER, LIP_OUTER, interocular_px
from vermilion.storage.sequences import read_sequence
from vermilion.studio.labels import lip_contours
from vermilion.studio.surface import surface_of
from vermilion.tracking.result import TrackedTake

WIDTH_PX, FAILED_PX, LEAST_FOUND = 120.0, 3.0, 0.6


def true_contours(studio: FaceModel, truth_mm: np.ndarray, camera) -> list[dict[str, np.ndarray]]:
    """Outer and inner contour (n, 2) px of every frame of a truth (F, V', 3)."""
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
    """(F,) `closed`, `rounded` or `open`, by the true contours in the image."""
    width = np.array([np.ptp(loop["outer"][:, 0]) for loop in loops])
    opening = np.array([np.ptp(loop["inner"][:, 1]) for loop in loops]) / np.median(width)
    opening -= opening.min()  # the corners of a closed mouth lie lower than its middle
    return np.where(
        width < 0.85 * np.median(width), "rounded", np.where(opening < 0.06, "closed", "open")
    )


def distances(found, loops, width_px: float) -> dict[str, float]:
    """Mean distance of a frame's found contours and the true ones at the standard mouth width.

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


@dataclass(frozen=True)
class Found:
    """Contours of a frame, (n, 2) px, and which points met a maximum."""

    outer_px: np.ndarray
    inner_px: np.ndarray
    outer_found: np.ndarray
    inner_found: np.ndarray


def read_track(results: Path, take: str) -> tuple[FaceModel, TrackedTake, np.ndarray] | None:
    """The tracker's model, poses and meshes (F, V, 3); None where the take is not yet tracked."""
    folder = results / "takes" / take / "tracking"
    if not (folder / "C").is_dir():
        return None
    meshes = [read_sequence(path) for path in sorted((folder / "C").glob("*.npy"))]
    model = FaceModel.load(results / "face/tracker.npz")
    return model, TrackedTake.load(folder / "fit.npz"), np.concatenate(meshes)


def finder(tracked, track: LandmarkTrack, camera):
    """A function (frame, maps) -> contours."""
    settings = SearchSettings()
    if tracked:
        model, fit, coarse = tracked
        sampler = ContourSampler.of(model, 80, settings)
        turns, places = fit.world_from_head_rotation, fit.world_from_head_translation_mm
        return lambda f, maps: sampler.find(coarse[f], camera, maps, (turns[f], places[f]))

    def from_landmarks(frame, maps):
        points = track.points_px[frame]
        unit = float(interocular_px(points))
        start = loop_spline(points[LIP_OUTER], 80)
        lips = loop_spline(points[LIP_INNER], 80) - start
        outer = find_outer(maps[1], start, unit, settings)
        inner = find_inner(maps[0], outer.points, lips, unit, settings)
        return Found(outer.points, inner.points, outer.found, inner.found)

    return from_landmarks


def measure(results: Path, take: str, capture: Path, truth: Path, every: int = 1) -> pd.DataFrame:
    """A row a detector and frame."""
    folder = results / "takes" / take
    track = LandmarkTrack.load(sorted((folder / "landmarks").glob("0*.npz")))
    source = open_frames(capture)
    (camera,) = read_cameras(capture / "cameras").values()
    tracked = read_track(results, take)
    find = finder(tracked, track, camera)
    true_mm = np.load(truth / "vertices_mm.npy", mmap_mode="r")
    loops = true_contours(FaceModel.load(results / "face/studio.npz"), true_mm, camera)
    kinds = kinds_of(loops)
    width_px = float(np.median([np.ptp(loop["outer"][:, 0]) for loop in loops]))
    labels = label_paths(capture, camera.name)
    labelled = [
        LabelledFrame(source.read(camera.name, f), track.points_px[f], read_label(path), f)
        for f, path in labels.items()
    ]
    detectors = {"landmarks": LandmarkRidgeDetector()}
    rings = dict.fromkeys(range(len(true_mm)))
    if tracked:
        lips = TrackedLips.of(tracked[0])
        rings = {f: lips.rings_px(mesh, camera) for f, mesh in enumerate(tracked[2])}
        cfg = ContourDetectorConfig()
        detectors["track"] = learn_from_take(
            TrackRidgeDetector(),
            sorted(evenly(np.flatnonzero(track.valid).tolist(), cfg.track.frames)),
            lambda frame: source.read(camera.name, frame),
            track.points_px.__getitem__,
            rings.__getitem__,
            cfg.track.reach,
        )
        limits = cfg.label_tolerance, cfg.label_reach
        labelled, _ = without_lean(labelled, detectors["track"], rings.get, *limits)
    if labelled:
        detectors["boosted"] = train_detector(labelled, TrainingSettings())
    rows = []
    for frame in range(0, len(true_mm), every):
        if frame in labels:
            continue
        image = source.read(camera.name, frame) if track.valid[frame] else None
        for name, detector in detectors.items():
            row = {"detector": name, "frame": frame, "kind": kinds[frame], "failed": True}
            if image is not None:
                start = time.process_time()
                maps = detector.likelihood(image, track.points_px[frame], rings[frame])
                row["maps_cpu_s"] = time.process_time() - start
                found = find(frame, maps)
                row |= distances(found, loops[frame], width_px)
                enough = min(found.outer_found.mean(), found.inner_found.mean()) >= LEAST_FOUND
                near = max(row["outer_px"], row["inner_px"]) <= FAILED_PX
                row["failed"] = not (near and enough)
            rows.append(row)
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
    ).round(2)


def main() -> None:
    results, take, capture, truth = sys.argv[1:5]
    every = int(sys.argv[5]) if len(sys.argv) > 5 else 1
    table = measure(Path(results), take, Path(capture), Path(truth), every)
    print(summary(table).to_string())


if __name__ == "__main__":
    main()
