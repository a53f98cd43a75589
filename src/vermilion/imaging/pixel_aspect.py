"""Pixels that are not square: an image is resampled so that they are."""

from __future__ import annotations

import cv2
import numpy as np

#: Wider or narrower pixels than these are taken for a damaged tag.
LIMITS = (0.25, 4.0)


def square_size(width: int, height: int, aspect: float) -> tuple[int, int]:
    """(width, height) with square pixels of an image whose pixels are `aspect` times as wide as high.

    The side along which pixels are long is enlarged, so that no detail is lost. An aspect of 0 is
    unknown and counts as 1.

    Raises:
        ValueError: the aspect is outside `LIMITS`.
    """
    aspect = float(aspect)
    if aspect == 0.0 or not np.isfinite(aspect):
        return width, height
    if not LIMITS[0] <= aspect <= LIMITS[1]:
        raise ValueError(f"pixels {aspect:.3g} times as wide as high")
    if aspect >= 1.0:
        return round(width * aspect), height
    return width, round(height / aspect)


def resample(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """An image (h, w, channels) resampled to (width, height); the same array where it has it."""
    if (image.shape[1], image.shape[0]) == tuple(size):
        return image
    low, high = image.min(), image.max()
    resampled = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
    return np.clip(resampled, low, high).reshape(size[1], size[0], image.shape[2])
