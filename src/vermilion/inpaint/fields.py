"""Fields over a texture: sampling, low-pass with holes, filling of holes."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.imaging.images import LUMINANCE
from vermilion.imaging.sampling import sample_bilinear


def sample(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Bilinear values of an image (h, w[, c]) at points (..., 2), centres at half numbers.

    Float32 (..., [c]); the border is repeated.
    """
    return sample_bilinear(np.asarray(image, np.float32), np.asarray(points, np.float32))


#: Wider Gaussians are taken of an image of half the size or less, whose Gaussian is at least half as wide.
_WIDE = 8.0


def blur(values: np.ndarray, sigma: float) -> np.ndarray:
    """Gaussian of an image with zeros outside, (h, w, c) or (h, w).

    `values` (h, w, c) or (h, w); `sigma` in texels or pixels.
    """
    values = np.asarray(values, dtype=np.float32)
    if sigma <= 0:
        return values
    if sigma <= _WIDE:
        return cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    factor = 2 ** int(np.ceil(np.log2(sigma / _WIDE)))
    height, width = values.shape[:2]
    # Zeros all round: the result beside the border is interpolated too, and blocks are whole.
    bottom, right = 2 * factor - height % factor, 2 * factor - width % factor
    padded = cv2.copyMakeBorder(values, factor, bottom, factor, right, cv2.BORDER_CONSTANT, value=0)
    size = padded.shape[1] // factor, padded.shape[0] // factor
    small = cv2.resize(padded, size, interpolation=cv2.INTER_AREA)
    # Averages of blocks and interpolation between them blur already.
    own = (factor**2 - 1) / 12 / factor**2 + 1 / 6
    small = cv2.GaussianBlur(
        small, (0, 0), np.sqrt((sigma / factor) ** 2 - own), borderType=cv2.BORDER_CONSTANT
    )
    whole = cv2.resize(small, padded.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return whole[factor : factor + height, factor : factor + width]


def weighted_blur(
    values: np.ndarray, weights: np.ndarray, sigma: float
) -> tuple[np.ndarray, np.ndarray]:
    """Low-pass that ignores texels of weight 0 (normalised convolution).

    Args:
        values: (h, w, c) or (h, w).
        weights: (h, w).
        sigma: of the Gaussian, in texels or pixels.

    Returns:
        (means as `values`, support (h, w) in [0, 1]); zero where nothing supports the mean.
    """
    weights = np.asarray(weights, dtype=np.float32)
    expand = (slice(None), slice(None)) + (None,) * (np.ndim(values) - 2)
    support = blur(weights, sigma)
    total = blur(np.where(weights[expand] > 0, values, 0) * weights[expand], sigma)
    return total / np.maximum(support, 1e-6)[expand], support


def fill_holes(values: np.ndarray, known: np.ndarray, sigma: float = 1.5) -> np.ndarray:
    """Values continued smoothly from where they are known to everywhere.

    Each round doubles the width of the Gaussian and fills what it reaches, so that small holes are
    filled from close by. A few rounds of averaging remove the steps between the rounds.

    Args:
        values: (h, w, c) or (h, w).
        known: (h, w) bool.
        sigma: of the first round, in texels or pixels.

    Returns:
        float32, as `values`; zero where nothing is known.
    """
    if not known.any():
        return np.zeros_like(values, dtype=np.float32)
    filled = np.where(known[(...,) + (None,) * (np.ndim(values) - 2)], values, 0)
    filled = filled.astype(np.float32)
    missing = ~known
    width = sigma
    while missing.any():
        means, support = weighted_blur(values, known.astype(np.float32), width)
        reached = missing & (support > 1e-3)
        filled[reached] = means[reached]
        missing &= ~reached
        width *= 2.0
    everywhere = np.ones(known.shape, dtype=np.float32)
    for width in (4 * sigma, 2 * sigma, 2 * sigma, sigma):
        filled[~known] = weighted_blur(filled, everywhere, width)[0][~known]
    return filled


def luminance(linear: np.ndarray) -> np.ndarray:
    """Luminance (...,) of linear RGB `linear` (..., 3)."""
    return np.asarray(linear, dtype=np.float32) @ LUMINANCE
