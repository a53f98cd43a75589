"""Whether a found inner contour can be believed: it must be near the landmarks' lips or the tracked ones.

An edge in the image that neither the network nor the track knows of is another edge: of a hand, a
microphone, a moustache. Such a frame is left out and named, its contour never followed.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from vermilion.contours.curves import loop_spline


def ring_distance(ring_px: np.ndarray, other_px: np.ndarray) -> float:
    """Mean distance of two closed rings: of either to the other, the larger one. NaN where one is not known.

    Args:
        ring_px: (n, 2); other_px: (m, 2).
    """
    if not (np.isfinite(ring_px).all() and np.isfinite(other_px).all()):
        return np.nan
    dense, others = loop_spline(ring_px), loop_spline(other_px)
    there = cKDTree(others).query(dense)[0].mean()
    back = cKDTree(dense).query(others)[0].mean()
    return float(max(there, back))


def contradiction(
    inner_px: np.ndarray, known: Iterable[np.ndarray | None], unit_px: float, most_apart: float
) -> str:
    """Why a found inner contour is not believed; empty where it is.

    Args:
        inner_px: (n, 2) found.
        known: inner rings (m, 2) px of the landmarks and of the track; None: that has none.
        unit_px: inter-ocular distance.
        most_apart: the contour may lie so far from the nearest of them (mean, per `unit_px`).
    """
    apart = [ring_distance(inner_px, ring) / unit_px for ring in known if ring is not None]
    apart = [value for value in apart if np.isfinite(value)]
    if not apart or min(apart) <= most_apart:
        return ""
    return (
        f"the inner contour lies {min(apart):.3f} inter-ocular distances from both the landmarks' and the "
        "tracked lips: not followed"
    )
