"""The stage's own files: neutral, track, landmarks of the views."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from vermilion.landmarks.scheme import JAW
from vermilion.landmarks.views import LandmarkViews
from vermilion.multiview.anchors import Anchor
from vermilion.multiview.neutral import Neutral
from vermilion.multiview.track import Clip, Track
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError


def read_landmark_views(
    path: str | Path, wanted: Collection[str]
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Landmarks of the neutral in the cameras of `wanted`.

    Returns:
        (names, points (C, 66, 2) px, confidence (C, 66), zero for the sliding points of the jaw).
    """
    views = LandmarkViews.load(path)
    names = [str(name) for name in views.cameras]
    use = [index for index, name in enumerate(names) if name in wanted]
    if len(use) < 2:
        raise InputError(
            f"a face in {len(use)} views",
            "two or more",
            "Look at the landmark overlay; give landmark labels where the detector fails.",
            path=path,
        )
    confidence = views.confidence[use].astype(np.float64)
    confidence[:, JAW] = 0.0  # its silhouette slides over the skin from view to view
    return [names[index] for index in use], views.points_px[use].astype(float), confidence


def write_neutral(path: str | Path, neutral: Neutral) -> None:
    """`.npz`: vertices_mm (V, 3); information (V,) 1/mm^2; landmarks_mm (66, 3), NaN unknown;
    first_take, moved_mm (V,) of a later take of the person."""
    write_arrays(
        path,
        vertices_mm=neutral.vertices_mm,
        information_per_mm2=neutral.information,
        landmarks_mm=neutral.landmarks.points_mm,
        landmarks_residual_px=neutral.landmarks.residual_px,
        first_take=np.array(neutral.first_take),
        moved_mm=np.broadcast_to(neutral.moved_mm, len(neutral.vertices_mm)),
    )


def read_neutral(path: str | Path, n_vertices: int, **place) -> np.ndarray:
    """Vertices (V, 3) mm of `write_neutral`; raises InputError, with the `place`, for another
    topology or numbers that are not finite."""
    vertices = read_arrays(path, "neutral", ("vertices_mm",), **place)["vertices_mm"]
    if vertices.shape != (n_vertices, 3) or not np.isfinite(vertices).all():
        raise InputError(
            f"a neutral of shape {vertices.shape}",
            f"({n_vertices}, 3) finite numbers, the template's vertices",
            "The template has changed: remove the file and run again.",
            path=path,
            **place,
        )
    return vertices


def write_anchor(path: str | Path, anchor: Anchor) -> None:
    """`.npz`: frame; vertices_mm (V, 3); window, similarity (W,)."""
    write_arrays(path, **vars(anchor))


def read_anchor(path: str | Path) -> Anchor:
    """What `write_anchor` wrote."""
    arrays = _load(path, ("frame", "vertices_mm", "window", "similarity"))
    return Anchor(
        int(arrays["frame"]), arrays["vertices_mm"], arrays["window"], arrays["similarity"]
    )


def write_clip(path: str | Path, clip: Clip) -> None:
    """`.npz`: frames (F,); coarse_mm (F, V, 3) float32; reasons."""
    coarse, reasons = clip.coarse_mm.astype(np.float32), np.array(clip.reasons, dtype=str)
    write_arrays(path, frames=clip.frames, coarse_mm=coarse, reasons=reasons)


def read_clip(path: str | Path) -> Clip:
    """What `write_clip` wrote."""
    arrays = _load(path, ("frames", "coarse_mm", "reasons"))
    reasons = tuple(str(reason) for reason in arrays["reasons"])
    return Clip(arrays["frames"], arrays["coarse_mm"], reasons)


def write_track(path: str | Path, track: Track) -> None:
    """`.npz`: frames, coarse_mm (F, V, 3) float32, similarity, anchors, reasons."""
    write_arrays(path, **{**vars(track), "reasons": np.array(track.reasons, dtype=str)})


def read_track(path: str | Path, frames: Sequence[int]) -> np.ndarray:
    """Coarse positions (F, V, 3) mm of some frames; raises InputError where one is missing."""
    arrays = _load(path, ("frames", "coarse_mm"))
    index = {int(number): i for i, number in enumerate(arrays["frames"])}
    missing = [number for number in frames if number not in index]
    if missing:
        raise InputError(
            f"a track without frames {missing[:5]}",
            "all frames of the chunk",
            "Remove the file and run again.",
            path=path,
        )
    return arrays["coarse_mm"][[index[number] for number in frames]]


def read_anchors(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(frames (F,), similarity (F,), anchors (F,) bool) of a track."""
    arrays = _load(path, ("frames", "similarity", "anchors"))
    return arrays["frames"], arrays["similarity"], arrays["anchors"]


def _load(path, names) -> dict[str, np.ndarray]:
    return read_arrays(path, "reconstruction", names)
