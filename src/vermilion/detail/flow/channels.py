"""Channels that the data terms compare: colours and their gradients, with their derivatives."""

from __future__ import annotations

import cv2
import numpy as np

#: Maps of an image, each of three colours: f, f_x, f_y, f_xx, f_xy, f_yy.
_BLUR_PX = 0.7


def channels(image: np.ndarray) -> np.ndarray:
    """Channels (h, w, 18) float32 of `image` (h, w, 3), display values: six times RGB."""
    smooth = cv2.GaussianBlur(image, (0, 0), _BLUR_PX, borderType=cv2.BORDER_REPLICATE)
    x, y = _across(smooth), _down(smooth)
    return np.concatenate([smooth, x, y, _across(x), _down(x), _down(y)], axis=2)


def structure_direction(image: np.ndarray, scale_px: float = 1.5) -> np.ndarray:
    """Unit direction (h, w, 2) across the structures of `image` (h, w, 3), float32.

    The main axis of the structure tensor, averaged over `scale_px`.
    """
    smooth = cv2.GaussianBlur(image, (0, 0), _BLUR_PX, borderType=cv2.BORDER_REPLICATE)
    x, y = _across(smooth), _down(smooth)
    parts = [(a * b).sum(axis=2) for a, b in ((x, x), (x, y), (y, y))]
    xx, xy, yy = (cv2.GaussianBlur(part, (0, 0), scale_px) for part in parts)
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.stack([np.cos(angle), np.sin(angle)], axis=2).astype(np.float32)


def _across(values: np.ndarray) -> np.ndarray:
    kernel = np.array([[-0.5, 0, 0.5]], dtype=np.float32)
    return cv2.filter2D(values, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)


def _down(values: np.ndarray) -> np.ndarray:
    kernel = np.array([[-0.5], [0], [0.5]], dtype=np.float32)
    return cv2.filter2D(values, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)
