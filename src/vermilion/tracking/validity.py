"""Which frames of a fitted take can be trusted, and why not."""

from __future__ import annotations

import numpy as np

from vermilion.storage.quality import QualityRow
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.result import TrackedTake


def valid_frames(
    motion: HeadMotion, shape: LandmarkShape, focal_px: float, max_reprojection: float
) -> np.ndarray:
    """Frames (F,) bool whose landmarks were found and whose reprojection error is small enough.

    `max_reprojection` is the largest RMS error, in inter-ocular distances.
    """
    interocular_px = focal_px * shape.interocular_mm / motion.translation_mm[:, 2]
    with np.errstate(invalid="ignore"):
        return motion.reprojection_px <= max_reprojection * interocular_px


def quality_rows(take: TrackedTake, rows: np.ndarray) -> list[QualityRow]:
    """Quality rows of some rows (n,) int of a tracked take."""
    result = []
    for row in rows:
        error, valid = float(take.reprojection_px[row]), bool(take.valid[row])
        if valid:
            reason = ""
        elif np.isnan(error):
            reason = "no landmarks; pose and weights interpolated"
        else:
            reason = f"landmarks miss the model by {error:.1f} px"
        result.append(QualityRow(int(take.frames[row]), valid, reason, {"reprojection_px": error}))
    return result
