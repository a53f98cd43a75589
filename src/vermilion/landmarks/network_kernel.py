"""The loop of `network_input` over pixels, compiled; imported only where a network looks at an image."""

from __future__ import annotations

import numpy as np

from vermilion.storage.kernels import kernel


@kernel()
def encode(pixels, curve, gain, offset, planes):
    """Planes (3, h, w) = gain * curve(pixels (h, w, 3)) + offset in one pass."""
    steps = np.float32(len(curve) - 2)
    for y in range(pixels.shape[0]):
        for x in range(pixels.shape[1]):
            for c in range(3):
                value = pixels[y, x, c]
                # Written so that NaN gives zero, and no place outside the table.
                value = value if value > 0 else np.float32(0)
                place = (value if value < 1 else np.float32(1)) * steps
                k = np.int32(place)
                here = curve[k]
                value = here + (place - np.float32(k)) * (curve[k + 1] - here)
                planes[c, y, x] = value * gain[c] + offset[c]
