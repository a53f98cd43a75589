"""The video of a page: original beside result, small enough to stand in the page itself."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from vermilion.imaging.video import VideoReader, write_video

#: Of the file; as text in a page it is a third larger.
MOST_BYTES = 9_000_000
#: Below this rate images are halved, which looks better than blocks (kilobits a second).
_LEAST_KBITS = 350.0
_COLUMNS = 3


def page_video(overlay: str | Path, fps: float, most_bytes: int = MOST_BYTES) -> bytes:
    """First and last column of an overlay of three, as H.264 of at most about `most_bytes`."""
    reader = VideoReader(overlay)
    kbits = most_bytes * 8 / 1000 / max(reader.n_frames / fps, 1.0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.mp4"
        images = _columns(reader, halve=kbits < _LEAST_KBITS)
        write_video(path, images, fps, most_kbits=kbits)
        return path.read_bytes()


def _columns(reader: VideoReader, halve: bool) -> Iterator[np.ndarray]:
    """(h, w, 3) uint8 of each frame."""
    for frame in range(reader.n_frames):
        image = reader.read(frame)
        width = image.shape[1] // _COLUMNS
        pair = np.hstack([image[:, :width], image[:, -width:]])
        if halve:
            pair = cv2.resize(pair, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        yield pair
