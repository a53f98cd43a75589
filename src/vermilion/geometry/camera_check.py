"""What makes numbers a camera: finite, with a focal length, an image, and a pose that is a rotation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap

from vermilion.storage.errors import InputError

#: How far from orthogonal a rotation may be that a file gives to four digits.
_ORTHOGONAL = 1e-3
_CHECK = "Check the calibration, and export it again."


def check_camera(
    path: str | Path,
    name: str,
    model: str,
    params: Sequence[float],
    size_px: tuple[int, int],
    cam_from_world: np.ndarray,
) -> None:
    """Raise InputError where numbers of a file are no camera.

    Args:
        path: of the file, for the message.
        name: of the camera.
        model: COLMAP's name of the lens model.
        params: of the model.
        size_px: (width, height) of its images.
        cam_from_world: (3, 4).
    """
    found = _lens(model, np.asarray(params, dtype=float)) or _size(size_px)
    remedy = _CHECK
    if not found:
        found = _pose(cam_from_world)
        remedy = (
            "Check the convention of the export: camera from world, x right, y down, z forward, "
            "right-handed."
        )
    if found:
        raise InputError(
            found,
            "finite numbers, a focal length and a size over 0, and a pose that is a rotation",
            remedy,
            camera=name,
            path=path,
        )


def _lens(model: str, params: np.ndarray) -> str:
    if not np.isfinite(params).all():
        return "parameters of the lens that are not finite"
    lens = pycolmap.Camera(model=model, width=1, height=1, params=params.tolist())
    focal = params[lens.focal_length_idxs()]
    return "" if (focal > 0).all() else f"a focal length of {focal.min():g} pixels"


def _size(size_px: tuple[int, int]) -> str:
    return "" if min(size_px) > 0 else f"an image size of {size_px[0]} x {size_px[1]} pixels"


def _pose(cam_from_world: np.ndarray) -> str:
    if not np.isfinite(cam_from_world).all():
        return "a pose that is not finite"
    rotation = cam_from_world[:, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHOGONAL):
        return "a pose that is no rotation"
    if np.linalg.det(rotation) < 0:
        return "a pose that is no rotation but a mirror image"
    return ""
