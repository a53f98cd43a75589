"""What falls across the outer border of the lips: colours along a ring's normals, and what parts lip from skin."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from vermilion.contours.curves import outward_normals, sampled

STEP_PX = 0.5
#: Deviation along the contour of what is learnt together (share of the ring).
ALONG = 3 / 80
LEAST_SPREAD = 0.02  # of a colour about its mean


def unwrapped(colours: np.ndarray, ring: np.ndarray, places: np.ndarray) -> np.ndarray:
    """`colours` (3, h, w) at `places` (T,) or (n, T) px outwards from a `ring` (n, 2) px: (n, T, 3)."""
    places = np.broadcast_to(places, (len(ring), np.shape(places)[-1]))
    points = ring[:, None] + places[..., None] * outward_normals(ring)[:, None]
    return np.stack([sampled(plane, points) for plane in colours], axis=-1)


def edge_strength(seen: np.ndarray, direction: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """How steeply the probability of lip falls outwards, (F, n, T) a pixel.

    Args:
        seen: (F, n, T, 3) colours along the normals.
        direction, middle: (n, 3), (n,) discriminants, as of `TrackRidgeDetector`.
    """
    log_odds = np.einsum("fntc,nc->fnt", seen, direction) - middle[None, :, None]
    lip = 1.0 / (1.0 + np.exp(-np.clip(log_odds, -30, 30)))
    return np.maximum(-np.gradient(lip, STEP_PX, axis=2), 0.0)


def normalised_strength(fall: np.ndarray) -> np.ndarray:
    """Strengths `fall` (n, T) in [0, 1]: a quarter of the ring is as clear as can be."""
    return np.minimum(fall / max(np.percentile(fall.max(axis=1), 75), 1e-6), 1.0)


def discriminants(
    seen: np.ndarray, places: np.ndarray, offset: np.ndarray, beside: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Linear discriminant of lip and skin at each sample: directions (n, 3) and middles (n,).

    Args:
        seen: (F, n, T, 3) colours at `places` (T,) from the ring.
        offset: (n,) of the border from the ring.
        beside: from where to where colours count, to either side of the border; as `places`.
    """
    away = places - offset[:, None]
    means, covariances = [], []
    for side in (-away, away):
        counts = ((side > beside[0]) & (side < beside[1])).astype(float)
        total = _along(len(seen) * counts.sum(axis=1))
        mean = _along(np.einsum("fntc,nt->nc", seen, counts)) / total[:, None]
        square = _along(np.einsum("fntc,fntd,nt->ncd", seen, seen, counts))
        means.append(mean)
        covariances.append(square / total[:, None, None] - mean[:, :, None] * mean[:, None])
    shared = 0.5 * (covariances[0] + covariances[1]) + LEAST_SPREAD**2 * np.eye(3)
    lip, skin = means
    direction = np.linalg.solve(shared, (lip - skin)[..., None])[..., 0]
    return direction, (0.5 * (lip + skin) * direction).sum(axis=1)


def _along(values: np.ndarray) -> np.ndarray:
    """Sums (n, ...) with those of the neighbours on the ring."""
    return gaussian_filter1d(values, ALONG * len(values), axis=0, mode="wrap")
