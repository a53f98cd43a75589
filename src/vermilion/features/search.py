"""Search for contours in likelihood maps along lines from the coarse model (Lips16 5.1).

Each sample of the outer contour looks along the gradient of the iso-lines, that is along the normal
of the contour. The offsets of all samples of a frame are chosen together, as the smoothest ring
through likely places near the model's (dynamic programming round the ring), then moved to the crest
of their ridge. Nothing is carried from frame to frame.

Rings are (n, 2) pixels, or (n, 3) mm in the head frame. There, normals lie in the head's frontal
plane and lines follow the depth of the coarse lips, so that every place on a line is a pixel of the
map put back on the template (Lips16 7), and a turned head is searched as a facing one is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vermilion.contours.curves import inward_normals, smoothed_ring
from vermilion.contours.paths import cheapest_ring, step_cost
from vermilion.features.arch import arch_depth
from vermilion.imaging.sampling import sample_bilinear

#: What the fourth power counts beside the square in the cost of an inner contour far from the model's.
_STEEP = 8.0


@dataclass(frozen=True)
class SearchSettings:
    """Lengths are per inter-ocular distance.

    Attributes:
        outward, inward: reach of the search for the outer contour about the model's.
        depth: reach of the search for the inner contour from the outer one.
        step: between the places that are looked at.
        least_likelihood: of a maximum that counts as found.
        model_weight: cost of one squared reach away from the model's contour (the inner one: 9 times
            as much, see `_distance_cost`).
        smooth_weight: cost of a slope of 1 between neighbouring samples, squared.
        floor: likelihood added everywhere, so that a hole in the map has a finite cost.
    """

    outward: float = 0.12
    inward: float = 0.12
    depth: float = 0.3
    step: float = 0.0025
    least_likelihood: float = 0.2
    model_weight: float = 2.0
    smooth_weight: float = 0.6
    floor: float = 0.02

    @classmethod
    def of(cls, section) -> SearchSettings:
        """From the section `features.contours` of the configuration."""
        same = ("depth", "step", "least_likelihood", "model_weight", "smooth_weight")
        return cls(section.reach, section.reach, **{name: getattr(section, name) for name in same})


@dataclass(frozen=True)
class FoundRing:
    """A detected contour.

    Attributes:
        points: (n, 2) px or (n, 3) mm, as the ring that the search started from.
        offset: (n,) along the search lines, per inter-ocular distance.
        found: (n,) bool; where False no maximum was there and the model's contour stands in.
    """

    points: np.ndarray
    offset: np.ndarray
    found: np.ndarray


def find_outer(
    likelihood: np.ndarray,
    ring: np.ndarray,
    unit: float,
    settings: SearchSettings,
    to_pixels: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> FoundRing:
    """The outer contour near the model's ring.

    Args:
        likelihood: (h, w) in [0, 1].
        ring: (n, 2) px or (n, 3) mm, samples of the model's outer contour.
        unit: inter-ocular distance, as the ring.
        settings: of the search.
        to_pixels: points (..., 3) of a ring in the head frame to pixels (..., 2).
    """
    normals = inward_normals(smoothed_ring(ring, 2))
    places = np.arange(-settings.outward, settings.inward + 1e-9, settings.step)
    lines, depth = ring[:, None] + places[:, None] * unit * normals[:, None], arch_depth(ring)
    lines[..., 2:] += depth(lines) - depth(ring)[:, None]
    profile = _profile(likelihood, to_pixels(lines))
    cost = -np.log(profile + settings.floor)
    cost += settings.model_weight * (places / settings.inward) ** 2
    chosen = cheapest_ring(cost, step_cost(ring / unit, settings.step, settings.smooth_weight))
    return _refined(profile, places, chosen, lines, settings)


def find_inner(
    likelihood: np.ndarray,
    outer: np.ndarray,
    lips: np.ndarray,
    unit: float,
    settings: SearchSettings,
    to_pixels: Callable[[np.ndarray], np.ndarray] = np.asarray,
    thickness: np.ndarray | None = None,
) -> FoundRing:
    """The inner contour, looked for from the found outer contour inwards.

    The inner contour is the first that a line meets: a place is less likely by the chance that
    the line met the contour before. A closed mouth needs no care: the upper and the lower half
    meet the same line. In the head frame a line starts at the depth of the outer contour and has that
    of the model's inner one from there on.

    Args:
        likelihood: (h, w) in [0, 1].
        outer: (n, 2) px or (n, 3) mm, found outer contour.
        lips: as `outer`, (n, 2) or (n, 3), from the samples of the model's outer contour to those of its inner one: where
            the outer contour is known, the model says how thick the lips are, not where.
        unit: inter-ocular distance, as the rings.
        settings: of the search.
        to_pixels: points (..., 3) of a ring in the head frame to pixels (..., 2).
        thickness: (n,) of the lips, per inter-ocular distance, where something better than the model tells it.
    """
    normals = inward_normals(smoothed_ring(outer, 4))
    places = np.arange(0.0, settings.depth + 1e-9, settings.step)
    expected = np.einsum("nk,nk->n", lips, normals) / unit if thickness is None else thickness
    expected = np.clip(smoothed_ring(expected, 2), 0.0, settings.depth)
    lines, depth = outer[:, None] + places[:, None] * unit * normals[:, None], arch_depth(outer)
    model_inner = outer + lips
    from_outer, from_inner = outer[:, 2:] - depth(outer), model_inner[:, 2:] - depth(model_inner)
    passed = np.minimum(places / np.maximum(expected, settings.step)[:, None], 1.0)[..., None]
    lines[..., 2:] = (
        depth(lines) + from_outer[:, None] * (1 - passed) + from_inner[:, None] * passed
    )
    profile = _profile(likelihood, to_pixels(lines))
    ridge = round(0.012 / settings.step)  # half the width of a ridge does not count as before
    before = np.cumsum(-np.log1p(-np.minimum(profile, 0.98)), axis=1) * (settings.step / 0.02)
    before = np.pad(before, ((0, 0), (ridge, 0)))[:, : len(places)]
    cost = -np.log(profile + settings.floor) + before
    cost += settings.model_weight * _distance_cost((places - expected[:, None]) / settings.inward)
    chosen = cheapest_ring(cost, step_cost(outer / unit, settings.step, settings.smooth_weight))
    return _refined(profile, places, chosen, lines, settings)


def _profile(likelihood: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Likelihood (n, m) float64 at `pixels` (n, m, 2); 0 outside the map (h, w)."""
    return sample_bilinear(likelihood.astype(np.float32), pixels, "zero").astype(np.float64)


def _distance_cost(reaches: np.ndarray) -> np.ndarray:
    """Cost of the inner contour so many reaches from the model's: little near it, steep far away.

    Where teeth touch a lip its ridge is weak, and that of the other lip must not stand in for it.
    """
    return reaches**2 + _STEEP * reaches**4


def _refined(
    profile: np.ndarray,
    places: np.ndarray,
    chosen: np.ndarray,
    lines: np.ndarray,
    settings: SearchSettings,
) -> FoundRing:
    """Move each choice to the nearest maximum within the ridge, to a fraction of a step."""
    n, m = profile.shape
    rows = np.arange(n)
    reach = max(round(0.0075 / settings.step), 1)
    near = np.clip(chosen[:, None] + np.arange(-reach, reach + 1), 1, m - 2)
    best = near[rows, profile[rows[:, None], near].argmax(axis=1)]
    left, top, right = (profile[rows, best + k] for k in (-1, 0, 1))
    maximum = (top >= left) & (top >= right) & (top >= settings.least_likelihood)
    bend = left - 2 * top + right
    shift = np.where(bend < -1e-12, 0.5 * (left - right) / np.where(bend < -1e-12, bend, 1.0), 0.0)
    place = np.where(maximum, best + np.clip(shift, -0.5, 0.5), chosen)
    below = np.clip(np.floor(place).astype(int), 0, m - 2)
    part = (place - below)[:, None]
    points = lines[rows, below] * (1 - part) + lines[rows, below + 1] * part
    return FoundRing(points, places[0] + place * settings.step, maximum)
