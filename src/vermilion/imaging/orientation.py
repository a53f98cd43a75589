"""Turned and mirrored images: EXIF orientation of image files, display matrix of videos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Orientation:
    """One of the eight ways in which a stored image is laid out for display.

    Attributes:
        transposed: rows become columns, first.
        mirrored: then columns are reversed.
        upended: then rows are reversed.
    """

    transposed: bool = False
    mirrored: bool = False
    upended: bool = False

    def size(self, width: int, height: int) -> tuple[int, int]:
        """(width, height) of the image as displayed."""
        return (height, width) if self.transposed else (width, height)

    def apply(self, image: np.ndarray) -> np.ndarray:
        """The image (h, w, ...) as displayed; the same array where nothing is to be done."""
        if self == UPRIGHT:
            return image
        if self.transposed:
            image = image.swapaxes(0, 1)
        rows = slice(None, None, -1 if self.upended else 1)
        columns = slice(None, None, -1 if self.mirrored else 1)
        return np.ascontiguousarray(image[rows, columns])


UPRIGHT = Orientation()

#: EXIF 2.3, tag 0x0112.
_EXIF = {
    1: UPRIGHT,
    2: Orientation(mirrored=True),
    3: Orientation(mirrored=True, upended=True),
    4: Orientation(upended=True),
    5: Orientation(transposed=True),
    6: Orientation(transposed=True, mirrored=True),
    7: Orientation(transposed=True, mirrored=True, upended=True),
    8: Orientation(transposed=True, upended=True),
}


def orientation_of_exif(tag: int) -> Orientation:
    """Orientation of an EXIF tag; values that EXIF does not define count as upright."""
    return _EXIF.get(int(tag), UPRIGHT)


def orientation_of_matrix(matrix: Sequence[int] | np.ndarray) -> Orientation:
    """Orientation of a display matrix of MP4 and QuickTime.

    Args:
        matrix: (9,) numbers a b u, c d v, x y w; a stored pixel (p, q), q down, is shown at
            (a p + c q + x, b p + d q + y).

    Raises:
        ValueError: it turns by an angle that is no multiple of 90 degrees.
    """
    a, b, _, c, d = (float(value) for value in matrix[:5])
    largest = max(abs(a), abs(b), abs(c), abs(d))
    small = 1e-3 * largest
    if largest == 0.0:
        return UPRIGHT
    if abs(b) <= small and abs(c) <= small and min(abs(a), abs(d)) > small:
        return Orientation(False, a < 0, d < 0)
    if abs(a) <= small and abs(d) <= small and min(abs(b), abs(c)) > small:
        return Orientation(True, c < 0, b < 0)
    raise ValueError(f"a turn by {np.degrees(np.arctan2(b, a)):.1f} degrees")
