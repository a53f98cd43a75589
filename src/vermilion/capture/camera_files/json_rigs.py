"""Cameras of the data sets Multiface (`KRT`, JSON) and NeRSemble (`camera_params.json`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vermilion.capture.camera_files.rig_file import (
    RawCamera,
    RigFile,
    Sizes,
    opencv_lens,
    pose,
    unreadable,
)
from vermilion.storage.json_files import load_json

_METRE_MM = 1000.0
_HALF = 0.5  # both count pixels from the centre of the first one
_MATRIX = ("K", "intrinsics", "intrinsic", "intrin", "camera_matrix")
_POSE = ("RT", "extrinsics", "extrinsic", "extrin", "world_2_cam", "cam_from_world", "w2c")
_WANTED = "JSON of NeRSemble or Multiface"


def read_json(path: Path, sizes: Sizes) -> RigFile:
    """Read `world_2_cam` and `intrinsics` (NeRSemble, metres), or a matrix and pose a camera.

    The pose is camera from world, (3, 4) or (4, 4).

    Raises InputError where the file has neither.
    """
    try:
        content = load_json(path)
        if "world_2_cam" in content:
            return _nersemble(content, sizes)
        entries = content.get("KRT", content.get("cameras", content))
        if isinstance(entries, list):
            entries = {_label(entry): entry for entry in entries}
        cameras = {str(name): _camera(entry) for name, entry in entries.items()}
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        IndexError,
        StopIteration,
    ) as error:
        raise unreadable(path, _WANTED, error) from error
    if not cameras:
        raise unreadable(path, _WANTED, "no camera")
    return RigFile(
        cameras, None, (f"JSON with a matrix and a pose a camera, {len(cameras)} cameras",)
    )


def _label(entry: dict[str, Any]) -> str:
    return str(next(entry[key] for key in ("cameraId", "name", "id", "serial") if key in entry))


def _nersemble(content: dict[str, Any], sizes: Sizes) -> RigFile:
    shared = content["intrinsics"]
    cameras = {}
    for name, matrix in content["world_2_cam"].items():
        own = shared[name] if isinstance(shared, dict) else shared
        model, params = opencv_lens(np.array(own, dtype=float), np.zeros(0), _HALF)
        transform = np.array(matrix, dtype=float)
        cameras[str(name)] = RawCamera(model, params, transform[:3, :4], sizes.get(str(name)))
    return RigFile(cameras, _METRE_MM, (f"NeRSemble, {len(cameras)} cameras, metres",))


def _camera(entry: dict[str, Any]) -> RawCamera:
    matrix = np.array(next(entry[key] for key in _MATRIX if key in entry), dtype=float)
    if "R" in entry:
        place = next(entry[key] for key in ("T", "t") if key in entry)
        transform = pose(np.array(entry["R"], dtype=float), np.array(place, dtype=float))
    else:
        found = next((entry[key] for key in _POSE if key in entry), None)
        if found is None:
            raise KeyError(f"a pose ({', '.join(_POSE)})")
        transform = np.array(found, dtype=float).reshape(-1, 4)[:3]
    bends: list[float] = next(
        (entry[key] for key in ("dist", "distortion", "D") if key in entry), []
    )
    model, params = opencv_lens(matrix.reshape(3, 3), np.array(bends, dtype=float), _HALF)
    size = (int(entry["width"]), int(entry["height"])) if "width" in entry else None
    return RawCamera(model, params, transform, size)


def read_krt(path: Path) -> RigFile:
    """Read Multiface's `KRT`: of each camera its name, K (3 lines), distortion, [R|t] (3 lines).

    Raises InputError where the file has another form.
    """
    try:
        lines = [line.split() for line in path.read_text().splitlines() if line.strip()]
        cameras = {}
        for start in range(0, len(lines), 8):
            (name,), *rest = lines[start : start + 8]
            numbers = [np.array(row, dtype=float) for row in rest]
            model, params = opencv_lens(np.stack(numbers[:3]), numbers[3], _HALF)
            cameras[name] = RawCamera(model, params, np.stack(numbers[4:7]).reshape(3, 4))
    except (OSError, ValueError, IndexError) as error:
        raise unreadable(path, "Multiface's KRT: eight lines a camera", error) from error
    if not cameras:
        raise unreadable(path, "Multiface's KRT", "no camera")
    return RigFile(cameras, 1.0, (f"Multiface KRT, {len(cameras)} cameras, millimetres",))
