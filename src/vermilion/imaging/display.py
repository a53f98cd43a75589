"""Display values, 0 to 255 (sRGB): the scale on which colours are compared.

The models are of linear light; a difference counts as it would be seen.
"""

from __future__ import annotations

import numpy as np

#: Steps of the table of `srgb8`: twenty a byte where the curve is steepest.
_STEPS = 65535
#: Values of an image from which on a compiled loop is worth its import, a quarter of a second.
_LARGE = 4_000_000
#: Values from which on a compiled power is: it takes 0.4 of the time, and fits raise thousands of such arrays.
_MANY = 10_000
_DARKEST = 0.003  # below, the slope of the curve stays as it is: noise is not amplified


def to_display_values(linear: np.ndarray) -> np.ndarray:
    """sRGB values 0 to 255 of `linear` light (...,), float64 (...,), not clipped above."""
    if np.size(linear) >= _MANY:
        from vermilion.imaging.display_kernel import display_values

        return display_values(np.ravel(linear)).reshape(np.shape(linear))
    return _curve(linear)


def _curve(linear: np.ndarray) -> np.ndarray:
    """As `to_display_values`, not compiled."""
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
    if linear.size < _LARGE:
        within = np.clip(np.nan_to_num(linear), 0, 1).astype(np.float32)
        return _SRGB8[(within * np.float32(_STEPS) + np.float32(0.5)).astype(np.int32)]
    from vermilion.imaging.display_kernel import look_up

    return look_up(np.ascontiguousarray(linear, dtype=np.float32), _SRGB8)


_SRGB8 = np.rint(_curve(np.arange(_STEPS + 1) / _STEPS)).astype(np.uint8)
