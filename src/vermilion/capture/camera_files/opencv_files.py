"""Cameras in OpenCV's YAML: a file a camera, or `intri.yml` beside `extri.yml`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vermilion.capture.camera_files.opencv_yaml import load_opencv_yaml
from vermilion.capture.camera_files.rig_file import (
    RawCamera,
    RigFile,
    opencv_lens,
    pose,
    unreadable,
)

_MATRIX = ("camera_matrix", "K", "cameraMatrix", "intrinsic", "M")
_DISTORTION = ("distortion_coefficients", "dist", "D", "distCoeffs", "distortion")
_ROTATION = ("R", "rotation", "rvec", "Rot")
_TRANSLATION = ("T", "t", "tvec", "translation")
_HALF = 0.5  # OpenCV's top-left pixel has its centre at (0, 0)
_WANTED = "OpenCV YAML with camera_matrix, distortion_coefficients, R and T (camera from world)"


def read_opencv(paths: list[Path]) -> RigFile:
    """Read the cameras of YAML files of OpenCV's FileStorage.

    Either a file a camera, named after it, or a pair with `K_<name>`, `dist_<name>`, `Rot_<name>` or
    `R_<name>`, `T_<name>`.

    Raises InputError where a file cannot be read or a camera lacks matrix or pose.
    """
    stores = [_open(path) for path in paths]
    names = [str(name) for store in stores for name in _listed(store)]
    cameras = {}
    if names:
        for name in dict.fromkeys(names):
            cameras[name] = _camera(stores, paths[0], name, f"_{name}")
    else:
        for path, store in zip(paths, stores, strict=True):
            cameras[path.stem] = _camera([store], path, path.stem, "")
    facts = (
        f"OpenCV YAML, {len(cameras)} cameras",
        "half a pixel added to principal points: OpenCV counts from the centre of the first pixel",
    )
    return RigFile(cameras, None, facts)


def _open(path: Path) -> dict[str, Any]:
    try:
        return load_opencv_yaml(path)
    except (OSError, ValueError) as error:
        raise unreadable(path, _WANTED, error) from error


def _listed(store: dict[str, Any]) -> list[Any]:
    names = store.get("names")
    return names if isinstance(names, list) else []


def _value(stores: list[dict[str, Any]], keys: tuple[str, ...], suffix: str) -> np.ndarray | None:
    for key in keys:
        for store in stores:
            value = store.get(f"{key}{suffix}")
            if isinstance(value, np.ndarray) and value.size:
                return value
    return None


def _camera(stores: list[dict[str, Any]], path: Path, name: str, suffix: str) -> RawCamera:
    matrix = _value(stores, _MATRIX, suffix)
    # A rotation matrix counts before a rotation vector, which some files hold under `R`.
    rotation = _value(stores, ("Rot",), suffix)
    rotation = _value(stores, _ROTATION, suffix) if rotation is None else rotation
    translation = _value(stores, _TRANSLATION, suffix)
    if matrix is None or rotation is None or translation is None:
        lacking = [
            what
            for what, value in (("matrix", matrix), ("R", rotation), ("T", translation))
            if value is None
        ]
        raise unreadable(path, _WANTED, f"camera {name} lacks {', '.join(lacking)}")
    if matrix.shape != (3, 3) or rotation.size not in (3, 9) or translation.size != 3:
        raise unreadable(path, _WANTED, f"camera {name} has matrices of other sizes")
    if rotation.size == 3:
        rotation = np.asarray(cv2.Rodrigues(rotation.reshape(3))[0])
    distortion = _value(stores, _DISTORTION, suffix)
    distortion = np.zeros(0) if distortion is None else distortion.reshape(-1)
    model, params = opencv_lens(matrix, distortion, _HALF)
    sides = [
        _number(stores, keys) for keys in (("image_width", "width"), ("image_height", "height"))
    ]
    size = (sides[0], sides[1]) if all(sides) else None
    return RawCamera(model, params, pose(rotation.reshape(3, 3), translation), size)


def _number(stores: list[dict[str, Any]], keys: tuple[str, ...]) -> int:
    for store in stores:
        for key in keys:
            value = store.get(key)
            if isinstance(value, int | float) and 0 < value < 1e6:
                return int(value)
    return 0
