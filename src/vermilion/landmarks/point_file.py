"""Landmarks of another tracker in a JSON file: the points of each frame, in pixels or in image sizes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.scheme import FROM_68
from vermilion.landmarks.sets import IBUG66, LandmarkSet
from vermilion.storage.errors import InputError
from vermilion.storage.json_files import load_json

_EXPECTED = (
    '{"unit": "px" or "image", "size_px": [width, height], "frames": {"0": [[x, y], ...], ...}}'
)


def read_point_file(
    path: str | Path,
    landmark_set: LandmarkSet = IBUG66,
    first_frame: int = 0,
    pixel_centre: float = 0.0,
    min_confidence: float = 0.5,
) -> dict[int, Landmarks]:
    """Read landmarks of the faces of a take, frame number -> landmarks; frames without a face are left out.

    A frame is a list of points (x, y) or (x, y, z), or `{"points": ..., "confidence": 0.9}`, or null. Unit
    `px`: pixels. `image`: x in widths and y in heights of the image, z in widths, as mediapipe gives them.

    Args:
        path: the file.
        landmark_set: what the points are; 68 points are taken for the 66 of `ibug66`.
        first_frame: number that the file gives to frame 0.
        pixel_centre: coordinates that it gives to the centre of the top-left pixel, with unit `px`.
        min_confidence: frames with less count as not found.

    Raises:
        InputError: the file is damaged, or has points of another set.
    """
    content = _content(path)
    scale, shift = _to_pixels(content, pixel_centre, path)
    found: dict[int, Landmarks] = {}
    for name, entry in content["frames"].items():
        frame = _frame(name, path) - first_frame
        points, confidence = _entry(entry, landmark_set, frame, path)
        if points is None or not np.isfinite(points[:, :2]).all() or confidence < min_confidence:
            continue
        depth = points[:, 2] * scale[2] if points.shape[1] == 3 else None
        sure = np.full(landmark_set.n_points, confidence)
        xy = points[:, :2] * scale[:2] + shift
        found[frame] = Landmarks(xy, sure, True, landmark_set, depth)
    return found


def _content(path: str | Path) -> dict[str, Any]:
    try:
        content = load_json(Path(path))
    except (OSError, ValueError) as error:
        raise _refused(f"an unreadable file ({error})", path) from error
    if not isinstance(content, dict) or not isinstance(content.get("frames"), dict):
        raise _refused("no object with frames", path)
    return content


def _to_pixels(
    content: dict[str, Any], pixel_centre: float, path: str | Path
) -> tuple[np.ndarray, float]:
    """What x, y and z are multiplied by, (3,), and what is added to x and y (px)."""
    unit = content.get("unit")
    if unit == "px":
        return np.ones(3), 0.5 - pixel_centre
    size = content.get("size_px")
    if unit != "image":
        raise _refused(f"the unit {unit!r:.20}", path)
    if not isinstance(size, list) or len(size) != 2 or not all(_is_size(n) for n in size):
        raise _refused(f"size_px {size!r:.40}", path)
    return np.array([size[0], size[1], size[0]], dtype=np.float64), 0.0


def _is_size(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 < value < 100_000


def _frame(name: str, path: str | Path) -> int:
    if not (name.isascii() and name.isdigit() and len(name) < 10):
        raise _refused(f"a frame {name!r:.20}", path)
    return int(name)


def _entry(
    entry: object, landmark_set: LandmarkSet, frame: int, path: str | Path
) -> tuple[np.ndarray | None, float]:
    """Points (N, 2 or 3) of a frame in the file's unit, None where it has no face, and their confidence."""
    confidence: object = 1.0
    if isinstance(entry, dict):
        confidence = entry.get("confidence", 1.0)
        entry = entry.get("points")
    if entry is None:
        return None, 0.0
    if not isinstance(confidence, int | float):
        raise _refused(f"a confidence {confidence!r:.20}", path, frame)
    try:
        points = np.array(entry, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise _refused("points that are no lists of numbers", path, frame) from error
    if landmark_set is IBUG66 and len(points) == 68:
        points = points[FROM_68]
    if points.shape not in ((landmark_set.n_points, 2), (landmark_set.n_points, 3)):
        raise InputError(
            f"points of shape {points.shape}",
            f"{landmark_set.n_points} points (x, y) or (x, y, z) of the set {landmark_set.name}",
            "Export all points, or name their set (landmarks.files.set).",
            frame=frame,
            path=path,
        )
    return points, float(confidence)


def _refused(found: str, path: str | Path, frame: int | None = None) -> InputError:
    return InputError(
        found, _EXPECTED, "Correct the file or export it again.", frame=frame, path=path
    )
