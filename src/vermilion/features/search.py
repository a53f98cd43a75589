"""Search for contours in likelihood maps along lines from the coarse model (Lips16 5.1).

Each sample of the projected outer contour looks along the gradient of the iso-lines, that is along
the normal of the contour. The offsets of all samples of a frame are chosen together, as the
smoothest ring through likely places near the model's (dynamic programming round the ring), then
moved to the crest of their ridge. Nothing is carried from frame to frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.contours.paths import cheapest_ring


@dataclass(frozen=True)
class SearchSettings:
    """Lengths are per inter-ocular distance.

    Attributes:
        outward, inward: reach of the search for the outer contour about the model's.
        depth: reach of the search for the inner contour from the outer one.
        step: between the places that are looked at.
        least_likelihood: of a maximum that counts as found.
        model_weight: cost of one squared reach away from the model's contour.
        smooth_weight: cost of a slope of 1 between neighbouring samples, squared.
        floor: likelihood added everywhere, so that a hole in the map has a finite cost.
    """

    outward: float = 0.12
    inward: float = 0.12
    depth: float = 0.3
    step: float = 0.0025
    least_likelihood: float = 0.2
    model_weight: float = 1.0
    smooth_weight: float = 0.6
    floor: float = 0.02

    @classmethod
    def of(cls, section) -> SearchSettings:
        """From the section `features.contours` of the configuration."""
        return cls(
            outward=section.reach,
            inward=section.reach,
            depth=section.depth,
            step=section.step,
            least_likelihood=section.least_likelihood,
            model_weight=section.model_weight,
            smooth_weight=section.smooth_weight,
        )


@dataclass(frozen=True)
class FoundRing:
    """A detected contour.

    Attributes:
        points_px: (n, 2).
        offset: (n,) along the search lines, per inter-ocular distance.
        found: (n,) bool; where False no maximum was there and the model's contour stands in.
    """

    points_px: np.ndarray
    offset: np.ndarray
    found: np.ndarray


def inward_normals(ring_px: np.ndarray) -> np.ndarray:
    """Unit normals (n, 2) of a closed ring (n, 2), towards its inside."""
    tangent = np.roll(ring_px, -1, axis=0) - np.roll(ring_px, 1, axis=0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    following = np.roll(ring_px, -1, axis=0)
    area = np.sum(ring_px[:, 0] * following[:, 1] - ring_px[:, 1] * following[:, 0])
    return normal if area > 0 else -normal


def smoothed_ring(values: np.ndarray, passes: int) -> np.ndarray:
    """(n, ...) values of a closed ring after binomial smoothing."""
    for _ in range(passes):
        values = 0.25 * np.roll(values, 1, axis=0) + 0.5 * values + 0.25 * np.roll(values, -1, 0)
    return values


def find_outer(
    likelihood: np.ndarray, ring_px: np.ndarray, unit_px: float, settings: SearchSettings
) -> FoundRing:
    """The outer contour near the model's ring.

    Args:
        likelihood: (h, w) in [0, 1].
        ring_px: (n, 2) samples of the model's outer contour in the image.
        unit_px: inter-ocular distance in pixels.
        settings: of the search.
    """
    normals = inward_normals(smoothed_ring(ring_px, 2))
    places = np.arange(-settings.outward, settings.inward + 1e-9, settings.step)
    profile = sample(likelihood, ring_px[:, None] + places[:, None] * unit_px * normals[:, None])
    cost = -np.log(profile + settings.floor)
    cost += settings.model_weight * (places / settings.inward) ** 2
    chosen = cheapest_ring(cost, _smoothness(ring_px, unit_px, settings))
    return _refined(profile, places, chosen, ring_px, normals, unit_px, settings)


def find_inner(
    likelihood: np.ndarray,
    outer_px: np.ndarray,
    model_inner_px: np.ndarray,
    unit_px: float,
    settings: SearchSettings,
) -> FoundRing:
    """The inner contour, looked for from the found outer contour inwards.

    The inner contour is the first that a line meets: a place is less likely by the chance that
    the line met the contour before. A closed mouth needs no care: the upper and the lower half
    meet the same line.

    Args:
        likelihood: (h, w) in [0, 1].
        outer_px: (n, 2) found outer contour.
        model_inner_px: (n, 2) samples of the model's inner contour in the image.
        unit_px: inter-ocular distance in pixels.
        settings: of the search.
    """
    normals = inward_normals(smoothed_ring(outer_px, 4))
    places = np.arange(0.0, settings.depth + 1e-9, settings.step)
    profile = sample(likelihood, outer_px[:, None] + places[:, None] * unit_px * normals[:, None])
    expected = np.einsum("nk,nk->n", model_inner_px - outer_px, normals) / unit_px
    expected = np.clip(smoothed_ring(expected, 2), 0.0, settings.depth)
    ridge = round(0.012 / settings.step)  # half the width of a ridge does not count as before
    before = np.cumsum(-np.log1p(-np.minimum(profile, 0.98)), axis=1) * (settings.step / 0.02)
    before = np.pad(before, ((0, 0), (ridge, 0)))[:, : len(places)]
    cost = -np.log(profile + settings.floor) + before
    cost += settings.model_weight * ((places - expected[:, None]) / settings.inward) ** 2
    chosen = cheapest_ring(cost, _smoothness(outer_px, unit_px, settings))
    return _refined(profile, places, chosen, outer_px, normals, unit_px, settings)


def sample(values: np.ndarray, points_px: np.ndarray) -> np.ndarray:
    """Bilinear values (h, w) at pixels (n, m, 2), zero outside, (n, m) float64."""
    x = (points_px[..., 0] - 0.5).astype(np.float32)
    y = (points_px[..., 1] - 0.5).astype(np.float32)
    found = cv2.remap(
        np.ascontiguousarray(values, dtype=np.float32),
        x,
        y,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0.0,
    )
    return found.astype(np.float64)


def _smoothness(ring_px: np.ndarray, unit_px: float, settings: SearchSettings) -> np.ndarray:
    """(n,) cost of one squared step between sample k and the next."""
    apart = np.linalg.norm(np.roll(ring_px, -1, axis=0) - ring_px, axis=1) / unit_px
    return settings.smooth_weight * (settings.step / np.maximum(apart, settings.step)) ** 2


def _refined(
    profile: np.ndarray,
    places: np.ndarray,
    chosen: np.ndarray,
    ring_px: np.ndarray,
    normals: np.ndarray,
    unit_px: float,
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
    crest = places[best] + np.clip(shift, -0.5, 0.5) * settings.step
    offset = np.where(maximum, crest, places[chosen])
    return FoundRing(ring_px + offset[:, None] * unit_px * normals, offset, maximum)
