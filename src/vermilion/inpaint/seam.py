"""Shading next to where the lips meet: read along the inner contours, sharp across them.

The low-passed change of light of `shading` is too smooth for the dark line between closed lips, and for
the shadow of one lip on the rim of the other. Along the contour, the tattoo's pattern averages out over a
few millimetres; there, each row of pixels at one distance from the contour gives its own light.
"""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.inpaint.composite import Layer, Window
from vermilion.inpaint.fields import luminance, sample
from vermilion.inpaint.opening import Opening

#: Lips only shade each other: the gain never lightens, and never makes a lip fully black.
_LARGEST, _SMALLEST = 1.0, 0.05


def seam_gain(
    opening: Opening, tattooed: Layer, linear: np.ndarray, reach_px: float, along_px: float
) -> np.ndarray:
    """Gain (h, w) of a layer's colours, 1 from `reach_px` away from the inner contours on.

    Args:
        tattooed: the tattooed lips under the layer's own shading.
        linear: (h, w, 3) the whole image, with the tattoo.
        along_px: deviation of the Gaussian average along the contours.
    """
    step = float(np.linalg.norm(opening.along_px))
    away = np.arange(int(np.ceil(reach_px / step)) + 1)[:, None]
    corner = np.array([tattooed.window.x, tattooed.window.y])
    bands = []
    for rows in (opening.upper - away, opening.lower + away):
        columns = np.broadcast_to(opening.columns.astype(float), rows.shape)
        place = opening.place(columns, rows)
        share = sample(tattooed.opacity, place - corner)
        seen = luminance(sample(linear, place)) * share
        expected = luminance(sample(tattooed.rgb, place - corner))
        bands.append(_ratio(seen, expected, share, along_px / step))
    return _spread(opening, bands, tattooed.window, reach_px / step)


def _ratio(seen: np.ndarray, expected: np.ndarray, share: np.ndarray, sigma: float) -> np.ndarray:
    """Seen over expected light of a straightened band (rows, columns), averaged along its rows."""

    def averaged(values: np.ndarray) -> np.ndarray:
        values = values.astype(np.float32)
        border = cv2.BORDER_REPLICATE
        return cv2.GaussianBlur(values, (0, 0), sigmaX=sigma, sigmaY=0.5, borderType=border)

    ratio = np.clip(averaged(seen) / np.maximum(averaged(expected), 1e-4), _SMALLEST, _LARGEST)
    return 1.0 + np.clip(averaged(share) / 0.3, 0.0, 1.0) * (ratio - 1.0)


def _spread(opening: Opening, bands: list[np.ndarray], window: Window, reach: float) -> np.ndarray:
    """The bands' ratios at the pixels of a window, faded out from half of the reach (rows) on."""
    x, y = np.meshgrid(np.arange(window.width) + 0.5, np.arange(window.height) + 0.5)
    pixels = np.stack([x + window.x, y + window.y], axis=-1)
    column, _ = opening.coordinates(pixels)
    row, upper, lower, between = opening.rows(pixels)
    is_upper = row <= 0.5 * (upper + lower)
    gain = np.ones(row.shape, dtype=np.float32)
    for band, away, here in zip(
        bands, (upper - row, row - lower), (is_upper, ~is_upper), strict=True
    ):
        place = np.stack([column - opening.columns[0], np.maximum(away, 0.0)], axis=-1) + 0.5
        fade = np.clip(2.0 - 2.0 * away / reach, 0.0, 1.0)
        gain = np.where(between & here, 1.0 + fade * (sample(band, place) - 1.0), gain)
    return gain
