"""The images of one moment from a rig, the frontal camera first."""

from __future__ import annotations

import sys

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.frames import FrameSource
from vermilion.storage.errors import InputError


def read_views(
    source: FrameSource, cameras: dict[str, Camera], frontal: str, frame: int, **place
) -> list[tuple[Camera, np.ndarray]]:
    """(camera, linear image) of every camera whose image can be read; the others are logged.

    Raises InputError where the frontal image cannot be read.
    """
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
            views.append((cameras[name], source.read(name, frame)))
        except InputError as error:
            if name == frontal:
                raise
            print(f"left out: {error}", file=sys.stderr)
    return views
