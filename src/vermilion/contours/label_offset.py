"""Whether the outer contours that a person drew lie on the border that the images show.

A hand draws to about a pixel, and leans the same way in all frames of a take: just inside the lips,
or round all that is a little red. A detector learns the lean with the rest. The border of the lips'
colour near the track (`track_ridge`) tells it, as neither depends on the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from vermilion.contours.curves import outward_normals
from vermilion.contours.labels import ContourLabel, Polyline
from vermilion.contours.ridges import blurred_colours
from vermilion.contours.track_ridge import TrackRidgeDetector
from vermilion.contours.training import LabelledFrame
from vermilion.landmarks.scheme import interocular_px
from vermilion.storage.quality import QualityRow


def outer_offset(
    frame: LabelledFrame, detector: TrackRidgeDetector, lips_px: tuple[np.ndarray, np.ndarray]
) -> float:
    """How far a drawn outer contour lies outside the border of the lips' colour, on the mean.

    Args:
        frame: the image with what was drawn on it.
        detector: the take's.
        lips_px: outer and inner ring (n, 2) of the tracked lips.

    Returns the distance per inter-ocular distance; negative inside.
    """
    region = detector.region(frame.landmarks_px, lips_px)
    border, _ = detector.outer_border(blurred_colours(region.crop(frame.linear_rgb)), region)
    border = region.to_image(border)
    drawn = frame.label.outer.dense()
    away = drawn[cKDTree(drawn).query(border)[1]] - border
    outwards = (away * outward_normals(border)).sum(axis=1)
    return float(outwards.mean() / interocular_px(frame.landmarks_px))


def moved_inwards(frame: LabelledFrame, offset: float) -> LabelledFrame:
    """The frame with its outer contour so much farther in (per inter-ocular distance)."""
    curve = replace(frame.label.outer, closed=True).dense(1.0)[:-1]
    curve = curve - offset * interocular_px(frame.landmarks_px) * outward_normals(curve)
    return replace(frame, label=ContourLabel(frame.label.inner, Polyline(curve, True)))


def without_lean(
    frames: Sequence[LabelledFrame],
    detector: TrackRidgeDetector,
    lips_px: Callable[[int], tuple[np.ndarray, np.ndarray] | None],
    tolerance: float,
    reach: float,
) -> tuple[list[LabelledFrame], list[QualityRow]]:
    """Labels on the border that the images show, and what is to be said of each.

    Where the median over the frames of `outer_offset` exceeds the tolerance, all outer contours are
    moved by it: what they say of each frame and each place stays. Beyond the reach they are not: the
    labels or the track are those of something else, and which of them nobody can tell.

    Args:
        frames: of one take.
        detector: the take's.
        lips_px: frame number -> rings (n, 2) of its tracked lips; None where it is not tracked.
        tolerance, reach: per inter-ocular distance.
    """
    rings = [lips_px(frame.number) for frame in frames]
    offsets = [
        np.nan if ring is None else outer_offset(frame, detector, ring)
        for frame, ring in zip(frames, rings, strict=True)
    ]
    lean = float(np.nanmedian(offsets)) if np.isfinite(offsets).any() else 0.0
    side = "outside" if lean > 0 else "inside"
    where = (
        f"labels lie {abs(lean):.4f} inter-ocular distances {side} the border of the lips' colour"
    )
    moved = tolerance < abs(lean) <= reach
    if moved:
        said = f"{where}: moved there"
    elif abs(lean) > reach:
        said = f"{where}, too far to be a lean: check labels"
    else:
        said = ""
    rows = [
        QualityRow(frame.number, reason=said, figures={"outer_offset": offset})
        for frame, offset in zip(frames, offsets, strict=True)
    ]
    return [moved_inwards(frame, lean) if moved else frame for frame in frames], rows
