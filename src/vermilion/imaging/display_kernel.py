"""The loops of `display` over many values, compiled."""

from __future__ import annotations

import numpy as np

from vermilion.storage.kernels import kernel


@kernel()
def look_up(linear, table):  # pragma: no cover - compiled
    """`linear` (h, w, 3) float32 through a table of [0, 1], (h, w, 3) uint8; NaN is the first entry."""
    steps = np.float32(len(table) - 1)
    result = np.empty(linear.shape, dtype=np.uint8)
    for y in range(linear.shape[0]):
        for x in range(linear.shape[1]):
            for c in range(3):
                value = linear[y, x, c]
                value = value if value > 0 else np.float32(0)  # NaN gives zero
                value = value if value < 1 else np.float32(1)
                result[y, x, c] = table[np.int32(value * steps + np.float32(0.5))]
    return result


@kernel()
def display_values(linear):  # pragma: no cover - compiled
    """sRGB values 0 to 255 of `linear` light (n,), float64 (n,), not clipped above."""
    result = np.empty(len(linear))
    for i in range(len(linear)):
        value = float(linear[i])
        if value > 0.0031308:
            result[i] = 255.0 * (1.055 * value ** (1 / 2.4) - 0.055)
        elif value < 0.0:
            result[i] = 0.0
        else:  # NaN stays
            result[i] = 255.0 * 12.92 * value
    return result
