"""Histograms of gradient orientations, dense and sampled (Dalal and Triggs 2005, simplified)."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.imaging.images import LUMINANCE, linear_to_srgb

N_ORIENTATIONS = 8


def grey_of(linear_rgb: np.ndarray) -> np.ndarray:
    """Display brightness (h, w) float32 in [0, 1] of `linear_rgb` (h, w, 3)."""
    return linear_to_srgb(linear_rgb @ LUMINANCE)


def orientation_channels(grey: np.ndarray) -> np.ndarray:
    """Gradient magnitude of `grey` (h, w) shared between the two nearest of 8 unsigned orientations,
    (h, w, 8)."""
    dx = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1, borderType=cv2.BORDER_REPLICATE)
    dy = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1, borderType=cv2.BORDER_REPLICATE)
    magnitude, angle = cv2.cartToPolar(dx, dy)
    place = angle * (N_ORIENTATIONS / np.pi)
    place -= N_ORIENTATIONS * (place >= N_ORIENTATIONS)
    channels = np.empty((*grey.shape, N_ORIENTATIONS), dtype=np.float32)
    for k in range(N_ORIENTATIONS):
        away = np.abs(place - k)
        np.minimum(away, N_ORIENTATIONS - away, out=away)
        channels[..., k] = magnitude * np.maximum(1.0 - away, 0.0)
    return channels


def patch_features(
    channels: np.ndarray, points: np.ndarray, cells: int, spacing_px: float
) -> np.ndarray:
    """Descriptors of the patches round points.

    Args:
        channels: (h, w, 8) blurred orientation channels.
        points: (N, 2) pixels, centres whole.
        cells: cells along each side of a patch.
        spacing_px: between cells.

    Returns:
        (N, cells * cells * 8) float32, each of unit length, peaks clipped.
    """
    height, width = channels.shape[:2]
    axis = (np.arange(cells) - (cells - 1) / 2) * spacing_px
    dx, dy = np.meshgrid(axis, axis)
    x = np.rint(points[:, None, 0] + dx.reshape(-1)).astype(np.int64)
    y = np.rint(points[:, None, 1] + dy.reshape(-1)).astype(np.int64)
    values = channels[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
    values = values.reshape(len(points), -1)
    values = values / (np.linalg.norm(values, axis=1, keepdims=True) + 0.02)
    values = np.minimum(values, 0.3)
    return values / (np.linalg.norm(values, axis=1, keepdims=True) + 1e-6)


def cell_map(grey: np.ndarray, cell_px: int) -> np.ndarray:
    """Orientation histograms of square cells of `grey` (h, w), normalised by what is round them:
    (h // cell_px, w // cell_px, 8)."""
    height, width = grey.shape[0] // cell_px, grey.shape[1] // cell_px
    channels = orientation_channels(grey[: height * cell_px, : width * cell_px])
    cells = cv2.resize(channels, (width, height), interpolation=cv2.INTER_AREA)
    energy = cv2.blur((cells**2).sum(axis=2), (3, 3), borderType=cv2.BORDER_REPLICATE)
    return np.minimum(cells / (np.sqrt(np.maximum(energy, 0)) + 0.01)[..., None], 0.6)
