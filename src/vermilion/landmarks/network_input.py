"""A piece of an image as the networks take it: sRGB, normalised, planes of 224 x 224."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from vermilion.imaging.images import linear_to_srgb

SIZE = 224
_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
_DEVIATION = np.array([0.229, 0.224, 0.225], dtype=np.float32)
# Interpolated, within 1e-6 of the curve, and small enough for the first cache.
_STEPS = 4096
_CURVE = linear_to_srgb(np.arange(_STEPS + 2) / _STEPS)


def network_input(linear_rgb: np.ndarray) -> np.ndarray:
    """(3, 224, 224) float32 of `linear_rgb` (h, w, 3) float32; values beyond [0, 1] are cut off."""
    # Resized first: the cost does not grow with the image.
    small = cv2.resize(linear_rgb, (SIZE, SIZE), interpolation=cv2.INTER_LINEAR)
    planes = np.empty((3, SIZE, SIZE), dtype=np.float32)
    _encode(small, _CURVE, 1 / _DEVIATION, -_MEAN / _DEVIATION, planes)
    return planes


@numba.njit(cache=True)
def _encode(pixels, curve, gain, offset, planes):
    """Planes (3, h, w) = gain * curve(pixels (h, w, 3)) + offset in one pass."""
    steps = np.float32(len(curve) - 2)
    for y in range(pixels.shape[0]):
        for x in range(pixels.shape[1]):
            for c in range(3):
                value = pixels[y, x, c]
                # Written so that NaN gives zero, and no place outside the table.
                value = value if value > 0 else np.float32(0)
                place = (value if value < 1 else np.float32(1)) * steps
                k = np.int32(place)
                here = curve[k]
                value = here + (place - np.float32(k)) * (curve[k + 1] - here)
                planes[c, y, x] = value * gain[c] + offset[c]
