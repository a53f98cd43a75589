"""Display values, 0 to 255 (sRGB): the scale on which colours are compared.

The models are of linear light; a difference counts as it would be seen.
"""

from __future__ import annotations

import numba
import numpy as np

#: Steps of the table of `srgb8`: twenty a byte where the curve is steepest.
_STEPS = 65535
_DARKEST = 0.003  # below, the slope of the curve stays as it is: noise is not amplified


def to_display_values(linear: np.ndarray) -> np.ndarray:
    """sRGB values 0 to 255 of `linear` light (...,), float64 (...,), not clipped above."""
    linear = np.maximum(linear, 0.0)
    curve = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, curve)


def display_slope(linear: np.ndarray) -> np.ndarray:
    """Derivative of `to_display_values` at `linear` light (...,): (...,)."""
    return 255.0 * 1.055 / 2.4 * np.maximum(linear, _DARKEST) ** (1 / 2.4 - 1)


def srgb8(linear: np.ndarray) -> np.ndarray:
    """`linear` RGB (h, w, 3) as sRGB uint8 by a table; beyond [0, 1] it is cut off, NaN is black.

    Bytes that became linear come back as they were.
    """
    return _srgb8(np.ascontiguousarray(linear, dtype=np.float32), _SRGB8)


_SRGB8 = np.rint(to_display_values(np.arange(_STEPS + 1) / _STEPS)).astype(np.uint8)


@numba.njit(cache=True)
def _srgb8(linear, table):
    result = np.empty(linear.shape, dtype=np.uint8)
    for y in range(linear.shape[0]):
        for x in range(linear.shape[1]):
            for c in range(3):
                value = linear[y, x, c]
                value = value if value > 0 else np.float32(0)  # NaN gives zero
                value = value if value < 1 else np.float32(1)
                result[y, x, c] = table[np.int32(value * np.float32(_STEPS) + np.float32(0.5))]
    return result
