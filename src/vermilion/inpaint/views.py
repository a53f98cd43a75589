"""The pictures of one moment from a rig, the frontal camera first."""

from __future__ import annotations

import sys

import numpy as np

from vermilion.arrays import read_arrays
from vermilion.camera import Camera
from vermilion.errors import InputError
from vermilion.frames import FrameSource


def read_views(
    source: FrameSource, cameras: dict[str, Camera], frontal: str, frame: int, **place
) -> list[tuple[Camera, np.ndarray]]:
    """(camera, linear picture) of every camera whose picture can be read; the others are logged.

    Raises InputError where the frontal picture cannot be read.
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


def read_neutral(path, n_vertices: int, **place) -> np.ndarray:
    """Vertices (V, 3) mm of a registered neutral; raises InputError where they do not fit."""
    vertices = read_arrays(path, "neutral", ["vertices_mm"], **place)["vertices_mm"].astype(float)
    if vertices.shape != (n_vertices, 3) or not np.isfinite(vertices).all():
        raise InputError(
            f"a neutral of shape {vertices.shape}",
            f"({n_vertices}, 3) finite numbers",
            "It was registered with another template: remove it and run again.",
            path=path,
            **place,
        )
    return vertices
