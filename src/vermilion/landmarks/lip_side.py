"""The inner lips followed by the red of the lips, so that flow does not stay on the teeth.

The inner contour is an outline: as the mouth opens, teeth appear on its other side, and flow there follows
them. So flow carries, in place of a point of the inner contour, one beside it on the lip: `SHARE` of the way
from the outer contour. Where the outer point and that one go, the line through them leads on to the inner one.
"""

from __future__ import annotations

import numpy as np

from vermilion.landmarks.scheme import LIP_INNER_OPEN, LIP_OUTER_FACING

#: Far enough from the seam for flow's patches (8 pixels at `face_px` 280, lips about 20 thick), and near
#: enough not to magnify errors of the two points by much.
SHARE = 0.75


def onto_lips(points_px: np.ndarray) -> np.ndarray:
    """`points_px` (..., 66, 2) with those of the inner contour moved onto the lips."""
    points = points_px.copy()
    outer = points[..., LIP_OUTER_FACING, :]
    points[..., LIP_INNER_OPEN, :] = outer + SHARE * (points[..., LIP_INNER_OPEN, :] - outer)
    return points


def off_lips(points_px: np.ndarray) -> np.ndarray:
    """The inverse: `points_px` (..., 66, 2) with the inner contour where it belongs."""
    points = points_px.copy()
    outer = points[..., LIP_OUTER_FACING, :]
    points[..., LIP_INNER_OPEN, :] = outer + (points[..., LIP_INNER_OPEN, :] - outer) / SHARE
    return points
