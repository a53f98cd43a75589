"""Values of an image between its pixels."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np

#: What lies beyond the image: its outermost pixels again, or zero.
Border = Literal["repeat", "zero"]
_BORDERS = {"repeat": cv2.BORDER_REPLICATE, "zero": cv2.BORDER_CONSTANT}
_LONGEST, _COLUMNS = 32767, 1024  # of a map of cv2.remap; points in a row are folded into columns
_FAR_PX = 1e6


def sample_bilinear(image: np.ndarray, pixels: np.ndarray, border: Border = "repeat") -> np.ndarray:
    """Bilinear values of an image at pixels.

    Args:
        image: (h, w) or (h, w, c), uint8 or float32.
        pixels: (..., 2) x and y, px; the centre of the top-left pixel is (0.5, 0.5). What is not
            finite lies beyond the image.
        border: what lies beyond the image.

    Returns:
        (...) or (..., c), of the image's type.
    """
    places = np.nan_to_num(pixels - np.float32(0.5), nan=-_FAR_PX, posinf=_FAR_PX, neginf=-_FAR_PX)
    places = places.astype(np.float32)
    shape = (*places.shape[:-1], *image.shape[2:])
    count = places.size // 2
    if places.ndim != 3 or max(places.shape) > _LONGEST:
        table = np.zeros((max(-(-count // _COLUMNS), 1) * _COLUMNS, 2), dtype=np.float32)
        table[:count] = places.reshape(-1, 2)
        places = table.reshape(-1, _COLUMNS, 2)
    image, places = np.ascontiguousarray(image), np.ascontiguousarray(places)
    if not count:
        return np.zeros(shape, dtype=image.dtype)
    found = cv2.remap(  # type: ignore[call-overload] # the stub wants a second map
        image, places, None, cv2.INTER_LINEAR, borderMode=_BORDERS[border]
    )
    return found.reshape(-1, *image.shape[2:])[:count].reshape(shape)
