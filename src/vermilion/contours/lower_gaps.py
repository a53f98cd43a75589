"""The dark between the teeth and a lower lip, which is the mouth's.

An upper lip ends in its own shade, and the edge of the teeth behind that shade is near its border. A lower lip
faces the light: between it and the upper teeth lies the mouth, often no more than a dark gap, whose edge
at the teeth is the stronger one. What is much darker than the lower lip is no part of it, so that its border
lies outside of that gap.
"""

from __future__ import annotations

import numpy as np

from vermilion.contours.curves import sampled

DARK = (0.65, 0.45)  # of no and of a sure gap: its lightness per the lower lip's
#: The corners of a mouth are dark anyway: no gap counts up to the first share of the lip's length from one,
#: all of it counts from the second.
SURE = (0.1, 0.25)
REACH_PX = 8.0  # a gap is looked for so far outside the search for the border
COST = 1.0  # of each pixel of a gap outside the border, against the clearest edge's 4


def lower_gaps(
    planes: tuple[np.ndarray, np.ndarray],
    curve: np.ndarray,
    normals: np.ndarray,
    step_px: float,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """How far each place beside a border is a gap (n, T), and what the gap outside of it costs (n, T).

    Zero beside the upper lip, the first half of the curve, and at the corners.

    Args:
        planes: (size, size) lightness, and 1 inside the lips' outer border.
        curve: (n, 2) px, the inner border so far; normals: (n, 2) outwards.
        step_px: between the places, `count` of them to either side of the curve (T = 2 count + 1).
    """
    half, more = len(curve) // 2, int(REACH_PX / step_px)
    places = step_px * np.arange(-count, count + more + 1)
    points = curve[half:, None] + places[None, :, None] * normals[half:, None]
    light, lip = sampled(planes[0], points), sampled(planes[1], points) > 0.5
    gap, cost = np.zeros((2, len(curve), 2 * count + 1))
    if not (outside := lip & (places > 0)).any():
        return gap, cost
    share = light / max(float(np.median(light[outside])), 1e-6)
    along = np.linspace(0.0, 1.0, len(points))
    sure = np.clip((np.minimum(along, 1 - along) - SURE[0]) / (SURE[1] - SURE[0]), 0.0, 1.0)
    dark = sure[:, None] * np.where(
        lip, np.clip((DARK[0] - share) / (DARK[0] - DARK[1]), 0.0, 1.0), 0.0
    )
    left = COST * step_px * np.cumsum(dark[:, ::-1], axis=1)[:, ::-1]
    gap[half:], cost[half:] = dark[:, : 2 * count + 1], left[:, : 2 * count + 1]
    return gap, cost
