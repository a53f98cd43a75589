"""A piece of an image as the networks take it: sRGB, normalised, planes of 224 x 224."""

from __future__ import annotations

import cv2
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
    from vermilion.landmarks.network_kernel import encode

    # Resized first: the cost does not grow with the image.
    small = cv2.resize(linear_rgb, (SIZE, SIZE), interpolation=cv2.INTER_LINEAR)
    planes = np.empty((3, SIZE, SIZE), dtype=np.float32)
    encode(small, _CURVE, 1 / _DEVIATION, -_MEAN / _DEVIATION, planes)
    return planes
