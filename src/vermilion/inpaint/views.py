"""The images of one moment from a rig, the frontal camera first."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from vermilion.geometry.camera import Camera, read_cameras
from vermilion.imaging.frames import open_frames
from vermilion.imaging.source import Source
from vermilion.storage.errors import InputError


def read_camera_images(
    source: Source, rig: str | Path, frontal: str, frame: int, **place
) -> list[tuple[Camera, np.ndarray]]:
    """(camera, linear image) of every camera whose image can be read; the others are logged.

    Args:
        source: of the take.
        rig: folder of its cameras (COLMAP text).
        frontal: name of the first camera.
        frame: number of the frame.
        place: subject and take.

    Raises InputError where the frontal image cannot be read.
    """
    cameras, images = read_cameras(rig), open_frames(source, **place)
    if frontal not in cameras:
        raise InputError(
            f"cameras {', '.join(cameras)}",
            f"one named {frontal}",
            "Correct `capture.frontal_camera`.",
            **place,
        )
    views = []
    for name in [frontal, *(name for name in cameras if name != frontal)]:
        try:
            views.append((cameras[name], images.read(name, frame)))
        except InputError as error:
            if name == frontal:
                raise
            print(f"left out: {error}", file=sys.stderr)
    return views
