"""Sharpness and noise of the painted region, matched to the image round it."""

from __future__ import annotations

import zlib

import numpy as np

from vermilion.imaging.images import linear_to_srgb, srgb_to_linear
from vermilion.inpaint.fields import blur, luminance

_FINE_PX = 1.5  # scales finer than this Gaussian count as grain


def fine_deviation(linear: np.ndarray, where: np.ndarray) -> float:
    """Robust deviation of the fine scales of display luminance over a mask, in [0, 1].

    `linear` (h, w, 3), `where` (h, w) bool.
    """
    grey = linear_to_srgb(luminance(linear))
    inside = where.astype(np.float32)
    support = np.maximum(blur(inside, _FINE_PX), 1e-3)
    fine = (grey - blur(grey * inside, _FINE_PX) / support)[where]
    if len(fine) < 50:
        return 0.0
    return float(1.4826 * np.median(np.abs(fine - np.median(fine))))


def missing_grain(image: np.ndarray, rendered: np.ndarray, where: np.ndarray) -> float:
    """Deviation of the noise that a rendering lacks, from bare skin that both show.

    `image` (h, w, 3) and `rendered` (h, w, 3) are linear, `where` (h, w) bool.
    """
    have, want = fine_deviation(rendered, where), fine_deviation(image, where)
    return float(np.sqrt(max(want**2 - have**2, 0.0)))


def add_grain(
    linear: np.ndarray, opacity: np.ndarray, deviation: float, seed: tuple[int, ...]
) -> np.ndarray:
    """A copy of an image with grey noise where it is painted, (h, w, 3).

    The noise has the spectrum of an image after demosaicing and compression: little at the finest
    scale.

    Args:
        linear: (h, w, 3) linear RGB.
        opacity: (h, w) of what is painted.
        deviation: of the noise, display values in [0, 1].
        seed: of the noise.
    """
    if deviation <= 0:
        return linear
    noise = blur(np.random.default_rng(seed).standard_normal(opacity.shape), 0.5)
    noise *= deviation / max(float(noise.std()), 1e-9)
    display = linear_to_srgb(linear) + (noise * opacity)[..., None]
    return np.where(opacity[..., None] > 0, srgb_to_linear(np.clip(display, 0, 1)), linear)


def noise_seed(seed: int, subject: str, take: str, frame: int) -> tuple[int, ...]:
    """Seed of one frame's noise; independent of chunks and order."""
    return seed, zlib.crc32(f"{subject}/{take}".encode()), frame
