"""What tells lips from what lies beside them in one image: planes of a region."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.contours.curves import inside_and_distance
from vermilion.contours.gums import flesh_plane
from vermilion.contours.region import SIDE

LINE_PX = (0.7, 1.2)  # of the dark line where lips touch: as fine as the shade above it allows
#: Just beside a border: from where to where colours count as lip's and as skin's (per inter-ocular distance).
BESIDE = (0.01, 0.04)
LEAST_SAMPLES = 20  # pixels that tell a colour
LEAST_SPREAD = 0.01  # of the lips' colour: evenly coloured lips would make all else an outlier


def lip_planes(
    colours: np.ndarray,
    curves: dict[str, np.ndarray],
    band: tuple[float, float],
    tolerance: float,
    beside: bool = False,
    outer: bool = True,
) -> dict[str, np.ndarray]:
    """(size, size) float32 planes in [0, 1]: two fall outwards across each contour, one is `flesh`.

    `outer`: probability of lip against skin, of two normal distributions with one covariance
    (linear discriminant) in the channels `colours` (3, size, size). `inner`: how far the colour is from
    the lips', which is high in the mouth's opening, on teeth and on the dark line of a closed mouth.
    What is lip, the `curves` (n, 2) of both contours and the band of the pass say; `beside`: for
    `outer`, what lies just beside its curve, as lips pale towards their border. `outer` false: without
    that plane.
    """
    size = colours.shape[1]
    inside, to_outer = inside_and_distance(curves["outer"], size)
    opening, to_inner = inside_and_distance(curves["inner"], size)
    ratio = to_outer / np.maximum(to_outer + to_inner, 1e-9)
    lip = inside & ~opening & (ratio > band[0]) & (ratio < band[1])
    scale = size / SIDE
    skin = ~inside & (to_outer > 0.05 * scale) & (to_outer < 0.12 * scale)
    if min(lip.sum(), skin.sum()) < LEAST_SAMPLES:
        return {name: np.zeros_like(colours[0]) for name in ("inner", "outer", "flesh")}
    sides = lip, skin
    if outer and beside:
        near = (to_outer > BESIDE[0] * scale) & (to_outer < BESIDE[1] * scale)
        found = inside & ~opening & near, ~inside & near
        sides = found if min(side.sum() for side in found) >= LEAST_SAMPLES else sides
    lips = colours[:, lip].T.astype(np.float64)
    away = colours.reshape(3, -1).T - lips.mean(axis=0)
    spread = _covariance(lips) + LEAST_SPREAD**2 * np.eye(3)
    squared = np.einsum("nk,nk->n", away @ np.linalg.inv(spread), away).reshape(size, size)
    planes = {
        "inner": (1.0 - np.exp(-squared / tolerance)).astype(np.float32),
        "flesh": flesh_plane(colours, lip),
    }
    return planes | {"outer": _probability(colours, *sides)} if outer else planes


def _probability(colours: np.ndarray, lip: np.ndarray, skin: np.ndarray) -> np.ndarray:
    """Of lip against skin (size, size), where masks (size, size) tell what either looks like."""
    lips, skins = (colours[:, mask].T.astype(np.float64) for mask in (lip, skin))
    shared = 0.5 * (_covariance(lips) + _covariance(skins))
    direction = np.linalg.solve(shared, lips.mean(axis=0) - skins.mean(axis=0))
    middle = 0.5 * (lips.mean(axis=0) + skins.mean(axis=0))
    log_odds = np.tensordot(direction, colours - middle[:, None, None], axes=1)
    return (1.0 / (1.0 + np.exp(-np.clip(log_odds, -30, 30)))).astype(np.float32)


def dark_lines(lightness: np.ndarray) -> np.ndarray:
    """How much darker a place of `lightness` (size, size) is than what lies beside it; else zero."""
    blurred = ((scale, cv2.GaussianBlur(lightness, (0, 0), scale)) for scale in LINE_PX)
    found = [scale**2 * cv2.Laplacian(plane, cv2.CV_32F) for scale, plane in blurred]
    return np.maximum(np.maximum(*found), 0.0)


def _covariance(samples: np.ndarray) -> np.ndarray:
    return np.cov(samples.T) + 1e-5 * np.eye(samples.shape[1])
