"""Open curves in an image: even samples, crossings, and lips that press (Guided18 section 5)."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.polylines import evenly_along, lengths_along


def resampled(points_px: np.ndarray, step_px: float, most: int) -> tuple[np.ndarray, float]:
    """Points (n, 2) evenly along a curve points_px (m, 2), about `step_px` apart, at most `most`; and the step."""
    length_px = lengths_along(points_px)[-1]
    count = int(np.clip(np.ceil(length_px / step_px), 1, most - 1)) + 1
    return evenly_along(points_px, count), length_px / (count - 1)


def first_self_crossing(points_px: np.ndarray) -> tuple[int, int] | None:
    """The first two segments (i, j) of an open curve points_px (n, 2) that cross; None where none do."""
    start, end = points_px[:-1], points_px[1:]
    for i in range(len(start) - 2):
        others = slice(i + 2, None)
        a, b, c, d = start[i], end[i], start[others], end[others]
        before = _turn(a, b, c) * _turn(a, b, d) < 0
        across = _turn(c, d, a) * _turn(c, d, b) < 0
        found = np.flatnonzero(before & across)
        if len(found):
            return i, i + 2 + int(found[0])
    return None


def mouth_axes(curves: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(along, up) unit vectors (2,) in the image: along the mouth, and across it towards the nose.

    Along the longest extent of all curves (n, 2) px; up has a negative y, as pixels count downwards.
    """
    points = np.concatenate(curves)
    centred = points - points.mean(axis=0)
    along = np.linalg.svd(centred, full_matrices=False)[2][0]
    along = along if along[0] >= 0 else -along
    return along, np.array([along[1], -along[0]])


def press_together(
    upper_px: np.ndarray, lower_px: np.ndarray, along: np.ndarray, up: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where the lower contour is drawn above the upper, both go to the middle between them.

    Args:
        upper_px, lower_px: (n, 2), (m, 2), dense.
        along: (2,) of `mouth_axes`.
        up: (2,) of `mouth_axes`.

    Returns:
        The two curves, and which points were moved, (n,) and (m,) bool.
    """
    moved, pressed = [], []
    for mine, other, sign in ((upper_px, lower_px, 1.0), (lower_px, upper_px, -1.0)):
        order = np.argsort(other @ along, kind="stable")
        places, heights = (other @ along)[order], (other @ up)[order]
        at = mine @ along
        across = np.interp(at, places, heights)
        covered = (at >= places[0]) & (at <= places[-1])
        crossed = covered & (sign * (across - mine @ up) > 0)
        shift = np.where(crossed, 0.5 * (across - mine @ up), 0.0)
        moved.append(mine + shift[:, None] * up)
        pressed.append(crossed)
    return moved[0], moved[1], pressed[0], pressed[1]


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area of the triangle a, b, c."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
        c[..., 0] - a[..., 0]
    )
