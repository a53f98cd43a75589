"""How high a person's lips are in a frame, learnt from all frames of the take.

Teeth in the shade, gums and tongues may have the lip's own colour, and then no edge of a single frame tells
where the lip ends. But how high a lip is, from its outer to its inner border, is known nearly: dense
landmarks say it, but for an error that the frames of a take share. They say it twice: by the height between
their two borders, and by where their inner border lies in the image. Most frames show their borders
clearly, so a robust line and a median over all of them tell these two errors; the mean of both is the told
height. A border that would make a lip higher or lower than told then costs more than one that does not. Higher
costs more than lower: what is mistaken for lip makes lips higher, and little makes them lower.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
#: Deviation of told heights, per inter-ocular distance. One deviation costs as a border one reach from its
#: start; a higher lip counts as if it deviated by more than it does, a lower one by less.
USUAL = 0.01
HIGHER, LOWER = 1.4, 0.7
FACTOR_ERROR = 0.5  # of the factor: where landmarks see lips unlike the take's, less is told
#: So is where the mouth is narrower than this share of the usual, as pursed lips are: deviation per share.
NARROW, NARROW_ERROR = 0.9, 0.25
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


@dataclass(frozen=True)
class SeenLips:
    """Lips of a frame as dense landmarks have them, per inter-ocular distance.

    Attributes:
        heights: (2, K) of the upper and the lower lip, between the landmarks' two rings.
        placed: (2, K) from the lips' found outer border to the landmarks' inner ring.
        width: of the mouth, between its corners.
    """

    heights: np.ndarray
    placed: np.ndarray
    width: float


def seen_lips(region: MouthRegion, outer: np.ndarray, interocular_px: float) -> SeenLips:
    """Lips of the landmarks' rings in a `region`, with the found `outer` border (n, 2) px."""
    inner, ring = loop_spline(region.inner_px), loop_spline(region.outer_px)
    return SeenLips(
        lip_heights(inner, ring) / interocular_px,
        lip_heights(inner, outer) / interocular_px,
        float(np.linalg.norm(ring[len(ring) // 2] - ring[0])) / interocular_px,
    )


def learn_lip_heights(
    seen: Sequence[SeenLips], found: Sequence[np.ndarray]
) -> tuple[np.ndarray, float]:
    """What tells heights from the landmarks': an array (2, K, 4), and the mouth's usual width.

    The last axis is the landmarks' usual height, the lip's own at that, by how much the lip's changes with the
    landmarks', and by how much it is higher than where the landmarks' inner ring lies. Of too few frames the
    array is empty, (0,).

    Args:
        seen: lips of each frame as landmarks have them.
        found: heights (2, K) of the borders that were found in it, per inter-ocular distance.
    """
    if len(seen) < LEAST_FRAMES:
        return np.zeros(0), 0.0
    own = np.stack(found, axis=1)
    heights = np.stack([lips.heights for lips in seen], axis=1)
    line = [_robust_line(*lip) for lip in zip(heights, own, strict=True)]
    beyond = np.median(own - np.stack([lips.placed for lips in seen], axis=1), axis=1)
    width = float(np.median([lips.width for lips in seen]))
    return np.concatenate([line, beyond[..., None]], axis=-1), width


def told_heights(
    usual: np.ndarray, usual_width: float, seen: SeenLips
) -> tuple[np.ndarray, np.ndarray]:
    """Heights of lips that landmarks have as `seen`, and their deviations, both (2, K).

    Args:
        usual: (2, K, 4) and `usual_width`, as of `learn_lip_heights`.
    """
    middle, own, factor, beyond = np.moveaxis(usual, -1, 0)
    away = seen.heights - middle
    by_height = np.maximum(own + factor * away, 0.0)
    by_place = np.maximum(seen.placed + beyond, 0.0)
    narrower = max(NARROW - seen.width / max(usual_width, 1e-6), 0.0)
    unsure = np.hypot(FACTOR_ERROR * away, NARROW_ERROR * narrower)
    return 0.5 * (by_height + by_place), np.hypot(USUAL, unsure)


def unusual_heights(
    usual: tuple[np.ndarray, float], region: MouthRegion, outer: np.ndarray, interocular_px: float
) -> np.ndarray:
    """What it costs if a lip ends at a pixel, (2, size, size) float32, of the upper and of the lower lip.

    Args:
        usual: heights (2, K, 4) and width as of `learn_lip_heights`.
        region: with the landmarks' rings.
        outer: (n, 2) px, the lips' outer border.
        interocular_px: inter-ocular distance in the region.
    """
    heights, width = usual
    seen, size = seen_lips(region, outer, interocular_px), region.size_px
    told, deviation = (interocular_px * values for values in told_heights(heights, width, seen))
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
        off = (distance - height) / spread
        off = np.where(off > 0, HIGHER * off, -LOWER * off)
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
