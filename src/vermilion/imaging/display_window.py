"""EXR: what a file stores (data window) laid into what it shows (display window)."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio


def to_display_window(pixels: np.ndarray, spec: oiio.ImageSpec) -> np.ndarray:
    """The display window of an image: overscan is cut, black stands where nothing is stored.

    Args:
        pixels: (h, w, channels), the data window.

    Returns:
        (full_height, full_width, channels); the same array where both windows are one.
    """
    data = (spec.x, spec.y, spec.width, spec.height)
    if data == (spec.full_x, spec.full_y, spec.full_width, spec.full_height):
        return pixels
    shown = np.zeros((spec.full_height, spec.full_width, pixels.shape[2]), dtype=pixels.dtype)
    left, top = spec.x - spec.full_x, spec.y - spec.full_y
    right = min(left + spec.width, spec.full_width)
    bottom = min(top + spec.height, spec.full_height)
    x, y = max(left, 0), max(top, 0)
    if right > x and bottom > y:
        shown[y:bottom, x:right] = pixels[y - top : bottom - top, x - left : right - left]
    return shown
