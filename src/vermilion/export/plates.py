"""The images of a take without lens distortion: the background of the exported camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.undistortion import undistorted
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_folder
from vermilion.storage.progress import progress


def write_plates(
    folder: str | Path,
    frames: Sequence[int],
    camera: Camera,
    read: Callable[[int], np.ndarray],
    suffix: str = ".jpg",
) -> None:
    """Write `<frame:06d>.jpg` of every frame that can be read, with square pixels.

    They are the images of `straight_camera(camera, square=True)`.

    Args:
        folder: to be written, whole or not at all.
        frames: frame numbers.
        camera: of the images, of any model.
        read: frame -> (h, w, 3) uint8 sRGB; it raises InputError for an image that is missing.
        suffix: of the files.
    """
    with atomic_folder(folder) as temporary:
        for frame in progress(list(frames), "plates"):
            try:
                image = undistorted(read(int(frame)), camera, square=True)[0]
            except InputError:
                continue
            write_srgb8(temporary / f"{int(frame):06d}{suffix}", image)
