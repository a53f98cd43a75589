"""Image channels of the mouth's region and their integral images, computed once a frame."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.imaging.images import linear_to_srgb

#: Integral images carry this many pixels on each side, so that patches never leave them.
PAD = 40
LEVELS = 1023  # channels are whole numbers, so that box sums are exact on every machine
ORIENTATIONS = 6
SCALES_PX = (1.0, 2.5)  # of the derivatives, in region pixels

COLOUR_CHANNELS = ("lightness", "red_green", "yellow_blue")
CHANNELS = (
    *COLOUR_CHANNELS,
    *(f"gradient_{s:g}px" for s in SCALES_PX),
    *(f"orientation_{s:g}px_{k}" for s in SCALES_PX for k in range(ORIENTATIONS)),
    "redness_gradient",
    *(f"blob_{s:g}px" for s in SCALES_PX),
)


def colour_channels(linear_rgb: np.ndarray) -> np.ndarray:
    """`COLOUR_CHANNELS` (3, h, w) float32 in [0, 1] of a region `linear_rgb` (h, w, 3), as of `image_channels`."""
    return _in_range(_colours(_lab(linear_rgb)))


def image_channels(linear_rgb: np.ndarray) -> np.ndarray:
    """`CHANNELS` (C, h, w) float32 in [0, 1] of a region `linear_rgb` (h, w, 3).

    The region's exposure is normalised first (its median lightness becomes middle grey), so that
    flicker does not matter.
    """
    lab = _lab(linear_rgb)
    channels, red = _colours(lab), lab[..., 1] / 128.0
    lightness = channels[0]
    magnitudes, orientations, blobs = [], [], []
    for sigma in SCALES_PX:
        smooth = cv2.GaussianBlur(lightness, (0, 0), sigma)
        magnitude, bins = oriented_gradient(smooth, sigma)
        magnitudes.append(4.0 * magnitude)
        orientations += [4.0 * plane for plane in bins]
        blobs.append(0.5 + 2.0 * sigma**2 * cv2.Laplacian(smooth, cv2.CV_32F))
    redness, _ = oriented_gradient(cv2.GaussianBlur(red, (0, 0), 1.5), 1.5)
    return _in_range([*channels, *magnitudes, *orientations, 6.0 * redness, *blobs])


def _lab(linear_rgb: np.ndarray) -> np.ndarray:
    luminance = linear_rgb @ np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
    gain = 0.18 / max(float(np.median(luminance)), 1e-4)
    return cv2.cvtColor(linear_to_srgb(linear_rgb * gain), cv2.COLOR_RGB2Lab)


def _colours(lab: np.ndarray) -> list[np.ndarray]:
    return [lab[..., 0] / 100.0, 0.5 + lab[..., 1] / 128.0, 0.5 + lab[..., 2] / 128.0]


def _in_range(channels: list[np.ndarray]) -> np.ndarray:
    return np.clip(np.stack(channels), 0.0, 1.0).astype(np.float32)


def oriented_gradient(smooth: np.ndarray, sigma: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Scale-normalised gradient of `smooth` (h, w): magnitude (h, w), and its share in each orientation."""
    gx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125 * sigma)
    gy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125 * sigma)
    magnitude = np.sqrt(gx * gx + gy * gy)
    position = np.arctan2(gy, gx) / np.pi * ORIENTATIONS
    planes = []
    for k in range(ORIENTATIONS):
        apart = np.abs((position - k + ORIENTATIONS / 2) % ORIENTATIONS - ORIENTATIONS / 2)
        planes.append(magnitude * np.maximum(1.0 - apart, 0.0))
    return magnitude, planes


def integral_images(channels: np.ndarray) -> np.ndarray:
    """Integral images (C, h + 2 PAD + 1, w + 2 PAD + 1) int32 of channels (C, h, w) in [0, 1]."""
    n_channels, height, width = channels.shape
    result = np.zeros((n_channels, height + 2 * PAD + 1, width + 2 * PAD + 1), dtype=np.int32)
    for index, plane in enumerate(channels):
        whole = np.rint(plane * LEVELS).astype(np.int32)
        padded = np.pad(whole, PAD, mode="edge")
        result[index, 1:, 1:] = padded.cumsum(axis=0, dtype=np.int32).cumsum(axis=1)
    return result
