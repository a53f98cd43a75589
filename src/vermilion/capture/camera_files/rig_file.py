"""What a file of calibrated cameras holds, in its own unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vermilion.storage.errors import InputError

Sizes = Mapping[str, tuple[int, int]]


@dataclass(frozen=True)
class RawCamera:
    """One camera in the file's unit, with the conventions of COLMAP.

    Attributes:
        model: COLMAP's name of the lens model.
        params: the model's parameters; the centre of the top-left pixel is (0.5, 0.5).
        cam_from_world: (3, 4), lengths in the file's unit.
        size_px: (width, height) that the file names; None: it names none.
    """

    model: str
    params: tuple[float, ...]
    cam_from_world: np.ndarray
    size_px: tuple[int, int] | None = None


@dataclass(frozen=True)
class RigFile:
    """Cameras of a file.

    Attributes:
        cameras: name -> camera.
        unit_mm: length of the unit that the format names; None: it names none.
        facts: what was understood, sentences.
    """

    cameras: dict[str, RawCamera]
    unit_mm: float | None = None
    facts: tuple[str, ...] = field(default=())


def unreadable(path: Path, what: str, error: Exception | str) -> InputError:
    """The error of a file that is no `what`."""
    return InputError(
        f"a file of cameras that cannot be read ({error})", what, "Export it again.", path=path
    )


def pose(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """(3, 4) of a rotation (3, 3) and a translation (3,)."""
    return np.concatenate([rotation, np.reshape(translation, (3, 1))], axis=1)


def opencv_lens(
    matrix: np.ndarray, distortion: np.ndarray, half_pixel: float
) -> tuple[str, tuple[float, ...]]:
    """COLMAP's model of OpenCV's matrix (3, 3) and distortion (n,): k1, k2, p1, p2, k3 to k6.

    `half_pixel` is added to the principal point: 0.5 where the top-left pixel's centre is (0, 0).
    """
    values = np.zeros(8)
    values[: min(8, len(distortion))] = distortion[:8]
    pinhole = (matrix[0, 0], matrix[1, 1], matrix[0, 2] + half_pixel, matrix[1, 2] + half_pixel)
    if not values.any():
        return "PINHOLE", tuple(float(value) for value in pinhole)
    if not values[4:].any():
        return "OPENCV", tuple(float(value) for value in (*pinhole, *values[:4]))
    return "FULL_OPENCV", tuple(float(value) for value in (*pinhole, *values))
