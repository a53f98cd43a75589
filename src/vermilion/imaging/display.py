"""Display values, 0 to 255 (sRGB): the scale on which colours are compared.

The models are of linear light; a difference counts as it would be seen.
"""

from __future__ import annotations

import numpy as np

_DARKEST = 0.003  # below, the slope of the curve stays as it is: noise is not amplified


def to_display_values(linear: np.ndarray) -> np.ndarray:
    """sRGB values 0 to 255 of `linear` light (...,), float64 (...,), not clipped above."""
    linear = np.maximum(linear, 0.0)
    curve = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, curve)


def display_slope(linear: np.ndarray) -> np.ndarray:
    """Derivative of `to_display_values` at `linear` light (...,): (...,)."""
    return 255.0 * 1.055 / 2.4 * np.maximum(linear, _DARKEST) ** (1 / 2.4 - 1)
