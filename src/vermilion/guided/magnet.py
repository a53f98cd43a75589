"""A stroke drawn by hand, pulled onto the contour that was detected nearby.

The likelihood map is sampled across the stroke; the smoothest path of high likelihood through these
samples is the new stroke. Where the map shows nothing, the stroke stays where it was drawn.
"""

from __future__ import annotations

import numpy as np

from vermilion.contours.paths import cheapest_path
from vermilion.guided.curves import resampled
from vermilion.imaging.sampling import sample_bilinear

#: How far a stroke is moved at most, as a share of its length; a mouth of 120 px: 6 px.
REACH_SHARE = 0.05
_STEP_PX = 0.25
_ALONG_PX = 2.0
_MOST_POINTS = 200
#: Cost of leaving the drawn place by the whole reach, and of a slope of 1, in likelihood of the map.
_LEAVING, _BENDING = 0.1, 1.5


def snap_to_contour(
    points_px: np.ndarray, likelihood: np.ndarray, reach_px: float | None = None
) -> np.ndarray:
    """The stroke moved onto the ridge of a likelihood map, (m, 2) px, evenly along it.

    Args:
        points_px: (n, 2) stroke; the centre of the top-left pixel is (0.5, 0.5).
        likelihood: (h, w) map of one contour, in [0, 1].
        reach_px: how far the stroke may be moved across itself; None: a share of its length.
    """
    points, step = resampled(np.asarray(points_px, dtype=np.float64), _ALONG_PX, _MOST_POINTS)
    if reach_px is None:
        reach_px = REACH_SHARE * step * (len(points) - 1)
    half = max(1, round(reach_px / _STEP_PX))
    offsets = np.arange(-half, half + 1) * _STEP_PX
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    across = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    places = points[:, None] + offsets[:, None] * across[:, None]
    cost = -sample_bilinear(likelihood, places, border="zero")
    cost = cost + _LEAVING * (offsets / reach_px) ** 2
    smoothness = np.full(len(points), _BENDING * (_STEP_PX / max(step, _STEP_PX)) ** 2)
    path = cheapest_path(cost, smoothness)
    return places[np.arange(len(points)), path]
