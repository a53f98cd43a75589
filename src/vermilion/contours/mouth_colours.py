"""The colours of a person's lips and of what shows between them, learnt from a take.

One frame alone does not tell a lip in its own shade from a dark mouth, nor the wet inside of a lip that is
turned out from a tongue. Other frames of the take do: what lies in the outer part of the lips and what
lies well inside the opening have colours of their own under the take's light, those of the upper lip, of
the lower lip, and of teeth, tongue and dark together. The inner border then lies where these two halves of
a line part best, however far from there the landmarks drew it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from vermilion.contours.curves import (
    distance_across,
    inside_and_distance,
    of_halves,
    outward_normals,
    sampled,
    smoothed_ring,
)
from vermilion.contours.gums import creases
from vermilion.contours.lip_heights import held_back
from vermilion.contours.paths import cheapest_ring, step_cost

#: Cells of the table along lightness, redness and yellowness per lightness, and what they span.
CELLS = 28
LOW, HIGH = (0.0, -0.15, -0.35), (1.0, 0.75, 0.65)
DARKEST = 0.06  # added to the lightness that colours are divided by
CELL_BLUR = 1.3  # deviation of the tables' blur (cells)
FLOOR = 7e-5  # the share that any cell has
MOST_ODDS = 1.5  # a colour alone says no more: logarithm of the odds of lip against mouth
SAMPLES = 400  # of a frame and kind, so that every frame counts alike
LEAST_SAMPLES, LEAST_FRAMES = 30, 2
#: Where lips are sure to be, from the outer (0) to the inner (1) border found before.
BAND = (0.12, 0.85)
INSIDE_PX = 2.0  # so far inside the inner border all is mouth
OPEN = 0.09  # narrower openings tell nothing of the mouth's inside: per inter-ocular distance
#: How far inside and outside its start the border is looked for, and how far it costs as much as the
#: clearest edge: per inter-ocular distance.
REACH, USUAL = (0.16, 0.04), 0.10
SHADE = 0.9  # per the lips' lightness: outside its start, what is darker may be a lip's own shade
ODDS_WEIGHT = 0.25  # of a pixel's odds, against `USUAL`
STIFFNESS = 1.5  # as of `contours.detector`: a rounded mouth has another shape than the network's
SLACK_PX = 3.0  # single edges, not colours, tell the border to this; they are looked for from there


def mouth_colours(colours: np.ndarray) -> np.ndarray:
    """Lightness, redness and yellowness per lightness, (h, w, 3), of `colours` (3, h, w).

    Args:
        colours: as `channels.COLOUR_CHANNELS`. Shade changes the first alone.
    """
    per = 1.0 / (colours[0] + DARKEST)
    return np.stack([colours[0], (colours[1] - 0.5) * per, (colours[2] - 0.5) * per], axis=-1)


def learn_lip_odds(
    colours: Sequence[np.ndarray],
    outer: Sequence[np.ndarray],
    inner: Sequence[np.ndarray],
    interocular_px: float,
) -> np.ndarray:
    """Log odds of lip against mouth of each cell of colour, (2, C, C, C): of the upper and the lower lip.

    Empty, (0,), where too few frames show the inside of the mouth.

    Args:
        colours: of each frame, (3, size, size).
        outer, inner: borders found by single frames, (n, 2) px; the upper lip is the first half.
        interocular_px: inter-ocular distance in the regions.
    """
    upper: list[np.ndarray] = []
    lower: list[np.ndarray] = []
    mouth: list[np.ndarray] = []
    for planes, around, opening in zip(colours, outer, inner, strict=True):
        inside, to_outer = inside_and_distance(around, planes.shape[1])
        within, to_inner = inside_and_distance(opening, planes.shape[1])
        seen = mouth_colours(planes)
        share = to_outer / np.maximum(to_outer + to_inner, 1e-6)
        rows, columns = np.nonzero(inside & ~within & (share > BAND[0]) & (share < BAND[1]))
        if len(rows) == 0:
            continue
        nearest = cKDTree(around).query(np.stack([columns, rows], axis=1) + 0.5)[1]
        first = nearest < len(around) // 2
        for kind, part in ((upper, first), (lower, ~first)):
            _add(kind, seen[rows[part], columns[part]])
        if 2 * to_inner[within].max(initial=0.0) > OPEN * interocular_px:
            _add(mouth, seen[within & (to_inner > INSIDE_PX)])
    if min(len(upper), len(lower), len(mouth)) < LEAST_FRAMES:
        return np.zeros(0)
    beside = np.log(_shares(mouth) + FLOOR)
    odds = [np.log(_shares(lip) + FLOOR) - beside for lip in (upper, lower)]
    return np.clip(odds, -MOST_ODDS, MOST_ODDS).astype(np.float32)


def lip_odds(table: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """Log odds (2, h, w) of `colours` (3, h, w), of the upper and the lower lip: `table` (2, C, C, C)."""
    cells = np.moveaxis(_cells(mouth_colours(colours)), -1, 0)
    return np.stack([lip[tuple(cells)] for lip in table])


def not_lip(odds: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Probability (h, w) that a pixel is no lip, of `odds` (2, h, w): the upper lip's above the mouth's middle.

    `inner` (n, 2) px: the inner border so far, whose halves lie to either side of the middle.
    """
    half = len(inner) // 2
    lower = np.concatenate([inner[half:], inner[:1]])[::-1]
    middle = 0.5 * (inner[: half + 1] + lower)
    order = np.argsort(middle[:, 0])
    at = np.interp(np.arange(odds.shape[2]) + 0.5, middle[order, 0], middle[order, 1])
    above = (np.arange(odds.shape[1]) + 0.5)[:, None] < at
    return 1.0 / (1.0 + np.exp(np.where(above, odds[0], odds[1])))


def to_colours(
    curve: np.ndarray,
    odds: np.ndarray,
    planes: tuple[np.ndarray, np.ndarray, np.ndarray],
    interocular_px: float,
    step_px: float,
    unusual: np.ndarray | None = None,
) -> np.ndarray:
    """The inner border's `curve` (n, 2) moved to where lip and mouth part best, less `SLACK_PX`.

    Args:
        odds: (2, size, size) as `lip_odds`.
        planes: lightness, flesh and lip of the image (size, size), as of `ridges.InnerCues`: what lies
            behind a crease is gums, whose colour is a lip's.
        interocular_px: inter-ocular distance in the region.
        step_px: between the places of the search.
        unusual: (2, size, size), what an unusual height of either lip costs, as of
            `lip_heights.unusual_heights`.
    """
    normals, across = outward_normals(curve), distance_across(curve)
    inwards, outwards = (int(share * interocular_px / step_px) for share in REACH)
    places = step_px * np.arange(-inwards, outwards + 1)
    points = curve[:, None] + places[None, :, None] * normals[:, None]
    light, flesh, lip = (sampled(plane, points) for plane in planes)
    seen = of_halves(odds, points)
    if (lips := (lip > 0.5) & (flesh > 0.5)).any():
        shade = (places > 0) & (light < SHADE * np.median(light[lips]))
        seen = np.where(shade, np.maximum(seen, 0.0), seen)
    behind = creases(light, flesh > 0.5, lip > 0.5, step_px)[1]
    beyond_middle = -places[None] > np.maximum(0.5 * across, INSIDE_PX)[:, None]
    seen = np.where((lip > 0.5) & ~beyond_middle, (1 - behind) * seen - behind, 0.0)
    # What is lip inside the border speaks against it: the sum from the mouth's middle outwards.
    cost = (
        ODDS_WEIGHT * step_px * np.cumsum(seen, axis=1) + (places / (USUAL * interocular_px)) ** 2
    )
    if unusual is not None:
        cost += held_back(unusual, points, places)
    cost[beyond_middle | ((lip < 0.5) & (places > 0))] = 1e3
    moved = places[cheapest_ring(cost, step_cost(curve, step_px, STIFFNESS))]
    moved = np.sign(moved) * np.maximum(np.abs(moved) - SLACK_PX, 0.0)
    return smoothed_ring(curve + moved[:, None] * normals, 2)


def _add(kind: list[np.ndarray], seen: np.ndarray) -> None:
    """Add evenly spread samples of `seen` (N, 3) to a kind, where there are enough."""
    if len(seen) >= LEAST_SAMPLES:
        kind.append(seen[np.linspace(0, len(seen) - 1, SAMPLES).astype(int)])


def _shares(samples: list[np.ndarray]) -> np.ndarray:
    """Blurred histogram (C, C, C) of samples (N, 3) of some frames; its sum is 1."""
    seen = np.concatenate(samples)
    counts = np.zeros((CELLS,) * 3)
    np.add.at(counts, tuple(_cells(seen).T), 1.0 / len(seen))
    return gaussian_filter(counts, CELL_BLUR, mode="nearest")


def _cells(seen: np.ndarray) -> np.ndarray:
    """Cell (..., 3) of each colour (..., 3)."""
    share = (seen - np.array(LOW)) / (np.array(HIGH) - np.array(LOW))
    return np.clip((CELLS * share).astype(int), 0, CELLS - 1)
