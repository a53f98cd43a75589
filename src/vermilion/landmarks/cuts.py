"""Where a video is cut: frames that look unlike the one before, for long and on both sides.

Each frame is described by a thumbnail and a histogram of its colours. A cut is a change far larger than
those around it: a shake, a pan or a dissolve changes many frames in a row and is none. A flash is none
either: the frames after it look like those before.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.imaging.images import linear_to_srgb

THUMBNAIL = (32, 18)
_LEVELS = 6
_COLOURS = _LEVELS**3
#: Frames to either side that say how much change is usual.
_AROUND = 12
#: Least distance of a cut, and least multiple of the usual one.
_LEAST, _TIMES = 0.2, 6.0
#: The same where landmarks jump as well; how far these jump, in face sizes, and over what is usual.
_LEAST_WITH_JUMP, _TIMES_WITH_JUMP, _JUMP = 0.02, 3.0, 0.12
#: A flash is over after this many frames.
_FLASH = 3


@dataclass(frozen=True)
class FrameLooks:
    """What frames look like as a whole.

    Attributes:
        thumbnails: (F, 18, 32, 3) uint8 display values; zero where no image could be read.
        colours: (F, 216) float32 share of the image in each of 6 x 6 x 6 ranges of colour.
    """

    thumbnails: np.ndarray
    colours: np.ndarray

    @classmethod
    def of(cls, looks: list[tuple[np.ndarray, np.ndarray]]) -> FrameLooks:
        """Of `looks`, thumbnail (18, 32, 3) and colours (216,) of each frame, as `frame_look` gives them."""
        thumbnails = np.array([t for t, _ in looks], np.uint8).reshape(-1, *THUMBNAIL[::-1], 3)
        return cls(thumbnails, np.array([c for _, c in looks], np.float32).reshape(-1, _COLOURS))

    @property
    def known(self) -> np.ndarray:
        """(F,) bool, frames whose image could be read."""
        return self.colours.sum(axis=1) > 0

    def distance(self, a: int | np.ndarray, b: int | np.ndarray) -> np.ndarray:
        """Difference (...,) of frames `a` and `b`, rows (...,): 0 is alike, about 1 another shot."""
        first, second = (self.thumbnails[rows].astype(np.float32) for rows in (a, b))
        apart = np.abs(first - second).mean(axis=(-3, -2, -1))
        spread = 0.5 * (_spread(first) + _spread(second)) + 5.0
        mixed = 0.5 * np.abs(self.colours[a] - self.colours[b]).sum(axis=-1)
        return np.minimum(apart / spread, 1.0) * 0.5 + mixed * 0.5


def _spread(images: np.ndarray) -> np.ndarray:
    """Mean distance (...,) of the pixels of images (..., h, w, 3) from their mean colour."""
    return np.abs(images - images.mean(axis=(-3, -2), keepdims=True)).mean(axis=(-3, -2, -1))


def frame_look(linear_rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thumbnail (18, 32, 3) uint8 and colours (216,) float32 of an image `linear_rgb` (h, w, 3)."""
    small = cv2.resize(
        linear_rgb, (2 * THUMBNAIL[0], 2 * THUMBNAIL[1]), interpolation=cv2.INTER_AREA
    )
    display = linear_to_srgb(np.clip(np.nan_to_num(small), 0.0, 1.0))
    level = np.minimum((display * _LEVELS).astype(np.int64), _LEVELS - 1).reshape(-1, 3)
    place = level @ np.array([_LEVELS**2, _LEVELS, 1])
    colours = np.bincount(place, minlength=_COLOURS) / len(place)
    thumbnail = cv2.resize(display, THUMBNAIL, interpolation=cv2.INTER_AREA)
    return np.rint(255 * thumbnail).astype(np.uint8), colours.astype(np.float32)


def no_look() -> tuple[np.ndarray, np.ndarray]:
    """What stands for a frame without an image: thumbnail (18, 32, 3) and colours (216,) of zero."""
    return np.zeros((*THUMBNAIL[::-1], 3), np.uint8), np.zeros(_COLOURS, np.float32)


def find_cuts(looks: FrameLooks, jumps: np.ndarray | None = None) -> np.ndarray:
    """Rows (C,) of the frames that begin a piece, but for the first.

    Args:
        looks: F frames.
        jumps: (F,) by how much the landmarks of the face moved from the frame before, in face sizes;
            infinite where the face is lost while others are there, NaN where nothing is known.
    """
    known = np.flatnonzero(looks.known)
    if len(known) < 2:
        return np.zeros(0, dtype=int)
    change = looks.distance(known[:-1], known[1:])
    usual = _usual(change)
    cut = (change > _LEAST) & (change > _TIMES * usual)
    if jumps is not None:
        jump = np.nan_to_num(jumps[known[1:]], nan=0.0, posinf=1e3)
        jumped = (jump > _JUMP) & (jump > _TIMES * _usual(np.minimum(jump, 1.0)))
        cut |= jumped & (change > _LEAST_WITH_JUMP) & (change > _TIMES_WITH_JUMP * usual)
    rows = [at for at in np.flatnonzero(cut) if not _is_flash(looks, known, int(at), change[at])]
    return known[np.array(rows, dtype=int) + 1]


def pieces_of(n_frames: int, cuts: np.ndarray) -> np.ndarray:
    """Piece (F,) int of each frame, counted from 0, of `cuts` (C,), the rows that begin one."""
    starts = np.zeros(n_frames, dtype=np.int64)
    starts[cuts] = 1
    return np.cumsum(starts)


def _usual(values: np.ndarray) -> np.ndarray:
    """Median (n,) of the values (n,) around each, itself and its neighbours left out."""
    result = np.empty_like(values)
    for at in range(len(values)):
        near = np.r_[max(at - _AROUND, 0) : max(at - 1, 0), at + 2 : at + _AROUND + 1]
        near = near[near < len(values)]
        result[at] = np.median(values[near]) if len(near) else 0.0
    return result


def _is_flash(looks: FrameLooks, known: np.ndarray, at: int, change: float) -> bool:
    """Whether a look from before the change `at` comes back soon after it."""
    before, after = known[max(at - _FLASH + 1, 0) : at + 1], known[at + 1 : at + 1 + _FLASH]
    apart = looks.distance(before[:, None], after[None])
    return bool(apart.min() < 0.5 * change)
