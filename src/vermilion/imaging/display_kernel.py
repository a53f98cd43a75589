"""The loop of `display.srgb8` over large images, compiled."""

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
