"""Where the landmarks off the eyes and lips lie on the generated head's chart.

Every layout has a vertex at exactly these points, so that landmarks mean the same on each mesh.
"""

from __future__ import annotations

import numpy as np

from vermilion.faces.procedural_head import chart_at, chart_of

# Jaw, subject's left from the ear to the chin: azimuth and polar angle in degrees.
_JAW = [(86, 87), (84, 96), (81, 105), (77, 114), (70, 121), (56, 125), (38, 127.5), (20, 128.5)]
_CHIN = (0.0, 129.0)
_BROW_MM = [(10.5, 44.5), (19, 47.5), (28, 48.8), (37, 48), (45.5, 44.2)]  # inner to outer
_BRIDGE_MM = [(0, 33), (0, 22), (0, 10), (0, -6)]
_NOSE_BASE_MM = [(11, -16), (6, -19), (0, -21)]


def anchor_chart() -> dict[int, complex]:
    """Landmark number (jaw 0-16, brows 17-26, nose 27-35) -> chart point."""
    left = np.array(_JAW, dtype=float)
    jaw = np.deg2rad(np.concatenate([left * [-1, 1], [_CHIN], left[::-1]]))
    brow = np.array(_BROW_MM, dtype=float)
    base = np.array(_NOSE_BASE_MM, dtype=float)
    frontal = np.concatenate([brow[::-1] * [-1, 1], brow, _BRIDGE_MM, base * [-1, 1], base[1::-1]])
    points = np.concatenate([chart_of(jaw[:, 1], jaw[:, 0]), chart_at(frontal)])
    return dict(enumerate(points))


def snap(
    chart: np.ndarray, free: np.ndarray, yielding: np.ndarray
) -> tuple[np.ndarray, dict[int, int]]:
    """Move the nearest free chart points onto the anchors, and their neighbours a little.

    Args:
        chart: (N,) complex.
        free: (N,) bool, points that may become an anchor.
        yielding: (N,) bool, points that may give way to a neighbour that became one.

    Returns:
        (moved chart (N,), landmark number -> point id).
    """
    moved, free, ids = chart.copy(), free.copy(), {}
    for landmark, target in anchor_chart().items():
        candidates = np.flatnonzero(free)
        apart = np.abs(moved[candidates] - target)
        nearest = int(candidates[np.argmin(apart)])
        reach = 3.0 * apart.min() + 1e-9
        around = candidates[(apart < 3.0 * reach) & yielding[candidates]]
        give = np.exp(-((np.abs(moved[around] - moved[nearest]) / reach) ** 2))
        moved[around] += give * (target - moved[nearest])
        moved[nearest], free[nearest], ids[landmark] = target, False, nearest
    return moved, ids
