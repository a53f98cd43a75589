"""How high a person's lips are in a frame, learnt from all frames of the take.

Teeth in the shade, gums and tongues may have the lip's own colour, and then no edge of a single frame tells
where the lip ends. But how high a lip is, from its outer to its inner border, is known nearly: dense
landmarks say it, but for an error that the frames of a take share. Most frames show their borders clearly,
so a robust line through all of them tells this error. A border that would make a lip much higher or lower
than told then costs more than one that does not.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.contours.curves import loop_spline, of_halves
from vermilion.contours.region import MouthRegion

#: Columns where heights are told, per the mouth's width. They count not at all up to the first of `SURE` from
#: a corner, and wholly from the second: the sides of a mouth that is wide open stand upright.
SHARES = np.linspace(0.1, 0.9, 17)
SURE = (0.2, 0.35)
DENSE = 960  # points of a half of the outer border, to which distances are taken
LEAST_FRAMES = 6
#: Of the robust line: its rounds, its least spread, and from how many spreads on a frame hardly counts.
ROUNDS, LEAST_SPREAD, FAR = 20, 0.005, 1.5
COLUMN_PRIOR = 2.0  # frames that speak for the same offset in all columns
FACTOR_PRIOR = 0.005  # smaller changes of the landmarks' height tell no factor
#: A lip higher or lower by so much costs as a border one reach from its start: per inter-ocular distance.
USUAL = 0.015
FACTOR_ERROR = 0.5  # of the factor: where landmarks see lips unlike the take's, less is told
MOST = 3.0  # deviations from which on the cost grows linearly


def halves_of(ring: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Upper and lower half of a ring (n, 2), each (n / 2 + 1, 2) from the first sample's corner to the other."""
    half = len(ring) // 2
    return ring[: half + 1], np.concatenate([ring[half:], ring[:1]])[::-1]


def lip_heights(inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """Heights (2, K) px of the upper and the lower lip in `SHARES` of the mouth.

    Each is the distance of a place on the `inner` border (n, 2) px to its lip's half of the `outer` (m, 2).
    """
    start, end = outer[0], outer[len(outer) // 2]
    along = (end - start) / max(float((end - start) @ (end - start)), 1e-6)
    down = np.array([-along[1], along[0]])
    found = []
    for half, border in zip(halves_of(inner), halves_of(outer), strict=True):
        share, depth = (half - start) @ along, (half - start) @ down
        order = np.argsort(share)
        at = np.interp(SHARES, share[order], depth[order])[:, None]
        points = start + SHARES[:, None] * (end - start) + at * down / max(down @ down, 1e-12)
        places, known = np.linspace(0, len(border) - 1, DENSE), np.arange(len(border))
        dense = np.stack([np.interp(places, known, axis) for axis in border.T], axis=1)
        found.append(cKDTree(dense).query(points)[0])
    return np.stack(found)


def seen_heights(region: MouthRegion) -> np.ndarray:
    """Heights (2, K) px of the lips between the rings of a `region`, as landmarks have them."""
    return lip_heights(loop_spline(region.inner_px), loop_spline(region.outer_px))


def learn_lip_heights(seen: Sequence[np.ndarray], found: Sequence[np.ndarray]) -> np.ndarray:
    """What tells heights from the landmarks': an array (2, K, 3); (0,) of too few frames.

    The last axis is the landmarks' usual height, the lip's own at that, and by how much the lip's changes
    with the landmarks'.

    Args:
        seen: heights (2, K) of each frame as landmarks have them, per inter-ocular distance.
        found: those (2, K) of the borders that were found in it.
    """
    if len(seen) < LEAST_FRAMES:
        return np.zeros(0)
    lips = zip(np.stack(seen, axis=1), np.stack(found, axis=1), strict=True)
    return np.stack([_robust_line(*lip) for lip in lips])


def told_heights(line: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights of the lips and their deviations, both (2, K), where landmarks have them `seen` (2, K) high.

    `line` (2, K, 3) as of `learn_lip_heights`; all per inter-ocular distance.
    """
    middle, usual, factor = np.moveaxis(line, -1, 0)
    away = seen - middle
    return np.maximum(usual + factor * away, 0.0), np.hypot(USUAL, FACTOR_ERROR * away)


def unusual_heights(
    line: np.ndarray, region: MouthRegion, outer: np.ndarray, interocular_px: float
) -> np.ndarray:
    """What it costs if a lip ends at a pixel, (2, size, size) float32, of the upper and of the lower lip.

    Args:
        line: (2, K, 3) as of `learn_lip_heights`.
        region: with the landmarks' rings.
        outer: (n, 2) px, the lips' outer border.
        interocular_px: inter-ocular distance in the region.
    """
    seen, size = seen_heights(region) / interocular_px, region.size_px
    told, deviation = (interocular_px * values for values in told_heights(line, seen))
    start, end = outer[0], outer[len(outer) // 2]
    along = (end - start) / max(float((end - start) @ (end - start)), 1e-6)
    centres = np.arange(size) + 0.5
    share = (centres[None, :] - start[0]) * along[0] + (centres[:, None] - start[1]) * along[1]
    sure = np.clip((np.minimum(share, 1.0 - share) - SURE[0]) / (SURE[1] - SURE[0]), 0.0, 1.0)
    costs = []
    for border, *lip in zip(halves_of(outer), told, deviation, strict=True):
        height, spread = (np.interp(share, SHARES, values) for values in lip)
        away = np.ones((size, size), dtype=np.uint8)
        cv2.polylines(away, [np.rint(border - 0.5).astype(np.int32)], False, 0)
        distance = cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        off = np.abs(distance - height) / spread
        costs.append(sure * np.where(off < MOST, off**2, MOST * (2 * off - MOST)))
    return np.stack(costs).astype(np.float32)


def held_back(unusual: np.ndarray, points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Costs (n, T) of a start's places: unusual heights hold it back inwards, and draw it nowhere outwards.

    Args:
        unusual: (2, size, size) as of `unusual_heights`.
        points: (n, T, 2) px, on lines outwards through a curve; places: (T,) px from it, one of them 0.
    """
    cost = of_halves(unusual, points)
    return np.where(places > 0, np.maximum(cost, cost[:, places == 0]), cost)


def _robust_line(seen: np.ndarray, found: np.ndarray) -> np.ndarray:
    """The line (K, 3) of one lip: `seen` and `found` (F, K). Its factor is the same in all columns."""
    middle, beyond = np.median(seen, axis=0), found - seen
    away = seen - middle
    offset, slope = np.median(beyond, axis=0), 0.0
    for _ in range(ROUNDS):
        rest = beyond - offset - slope * away
        spread = max(1.4826 * float(np.median(np.abs(rest))), LEAST_SPREAD)
        weight = 1.0 / (1.0 + (rest / (FAR * spread)) ** 2) ** 2
        rest = beyond - slope * away
        shared = (weight * rest).sum() / weight.sum()
        total = weight.sum(axis=0) + COLUMN_PRIOR
        offset = ((weight * rest).sum(axis=0) + COLUMN_PRIOR * shared) / total
        square = (weight * away**2).sum() + away.shape[1] * FACTOR_PRIOR**2
        slope = float((weight * away * (beyond - offset)).sum() / square)
    return np.stack([middle, middle + offset, np.full_like(offset, 1.0 + slope)], axis=1)
