"""Where the world of another tracker lies in the world of the capture.

A tracker that was given the capture's camera works in its world. Others have a world of their own: the
camera's, or one in which the head stands. Then one rigid motion a take is found, by which the mesh's
landmarks of all frames together project on those detected in the images.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vermilion.geometry.camera import Camera
from vermilion.landmarks.scheme import BROWS, EYE_LEFT, EYE_RIGHT, NOSE, interocular_px
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.tracking.landmark_fit.observation import focal_px, with_focal

#: Landmarks that place the head: those that neither lips nor jaw move.
STEADY = np.concatenate([BROWS, NOSE, EYE_RIGHT, EYE_LEFT])
#: Frames that are used, evenly spread over the take.
_FRAMES = 60
#: The world counts as the capture's where landmarks miss by so much more than they need (inter-ocular).
_AS_GIVEN = 0.02
_ROBUST = 0.02  # a landmark this far off counts less, inter-ocular distances
#: Deviation of the logarithm of an unknown focal length from the camera's guess.
_FOCAL_SIGMA = 0.3


@dataclass(frozen=True)
class Placement:
    """World of the capture = rotation @ world of the tracker + translation.

    Attributes:
        rotation: (3, 3).
        translation_mm: (3,).
        off: median distance of the steady landmarks from those detected, inter-ocular distances; NaN
            where there are none.
        as_given: whether the tracker's world is the capture's.
    """

    rotation: np.ndarray
    translation_mm: np.ndarray
    off: float = float("nan")
    as_given: bool = True

    def apply(self, points_mm: np.ndarray) -> np.ndarray:
        """The `points_mm` (..., 3) of the tracker's world in the capture's."""
        return points_mm @ self.rotation.T + self.translation_mm

    def undo(self, points_mm: np.ndarray) -> np.ndarray:
        """The `points_mm` (..., 3) of the capture's world in the tracker's."""
        return (points_mm - self.translation_mm) @ self.rotation

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(
            path, rotation=self.rotation, translation_mm=self.translation_mm,
            off=np.array(self.off), as_given=np.array(self.as_given),
        )  # fmt: skip

    @classmethod
    def load(cls, path: str | Path) -> Placement:
        """Read what `save` wrote."""
        names = ("rotation", "translation_mm", "off", "as_given")
        found = read_arrays(path, "placement of a tracker", names)
        return cls(
            found["rotation"], found["translation_mm"], float(found["off"]), bool(found["as_given"])
        )


def place_world(
    points_mm: np.ndarray,
    points_px: np.ndarray,
    camera: Camera,
    *,
    calibrated: bool = True,
    world: Literal["guess", "capture", "landmarks"] = "guess",
) -> tuple[Placement, Camera]:
    """Find the tracker's world, and the focal length where that is unknown and the world too.

    Args:
        points_mm: (F, 66, 3) landmarks of the mesh, the tracker's world; NaN in lost frames.
        points_px: (F, 66, 2) detected; NaN where there are none.
        camera: of the images.
        calibrated: whether the camera's focal length is known.
        world: `capture` and `landmarks` leave no choice.

    Returns:
        the placement, and the camera. Where no frame has landmarks the world is the capture's.
    """
    known = np.isfinite(points_mm).all(axis=(1, 2)) & np.isfinite(points_px).all(axis=(1, 2))
    rows = np.flatnonzero(known)
    if not len(rows):
        return Placement(np.eye(3), np.zeros(3)), camera
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(_FRAMES, len(rows))).astype(int))]
    unit_px = interocular_px(points_px[rows])[:, None]
    own, seen = points_mm[rows][:, STEADY], points_px[rows][:, STEADY]

    def off(place: Placement, through: Camera) -> float:
        away = np.linalg.norm(through.project(place.apply(own)) - seen, axis=2) / unit_px
        return float(np.median(np.where(np.isfinite(away), away, np.inf)))

    given = Placement(np.eye(3), np.zeros(3))
    given = Placement(given.rotation, given.translation_mm, off(given, camera))
    if world == "capture":
        return given, camera
    found, fitted = _registered(own, seen, unit_px, camera, calibrated)
    found = Placement(found.rotation, found.translation_mm, off(found, fitted), False)
    if world == "guess" and given.off <= found.off + _AS_GIVEN:
        return given, camera
    return found, fitted


def _registered(
    own: np.ndarray, seen: np.ndarray, unit_px: np.ndarray, camera: Camera, calibrated: bool
) -> tuple[Placement, Camera]:
    """The robust rigid motion of points (F, n, 3) onto pixels (F, n, 2), and the camera."""
    _, directions = camera.rays(seen.reshape(-1, 2))
    local = directions @ camera.rotation.T
    flat = np.ascontiguousarray(own.reshape(-1, 3))
    middle = flat.mean(axis=0)
    image = np.ascontiguousarray(local[:, :2] / local[:, 2:3])
    _, turn, shift = cv2.solvePnP(flat - middle, image, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    start = np.concatenate([turn.ravel(), shift.ravel(), [0.0]])
    scale = np.array([0.05, 0.05, 0.05, 5.0, 5.0, 20.0, 0.1])

    def parts(values: np.ndarray) -> tuple[Placement, Camera]:
        rotation = Rotation.from_rotvec(values[:3]).as_matrix()
        in_camera = values[3:6] - rotation @ middle
        to_world = camera.rotation.T
        place = Placement(to_world @ rotation, to_world @ (in_camera - camera.translation))
        if calibrated:
            return place, camera
        return place, with_focal(camera, focal_px(camera) * float(np.exp(values[6])))

    def residuals(values: np.ndarray) -> np.ndarray:
        place, through = parts(values)
        away = (through.project(place.apply(own)) - seen) / unit_px[..., None] / _ROBUST
        prior = values[6:] / _FOCAL_SIGMA * np.sqrt(len(seen))
        return np.concatenate([np.nan_to_num(away, nan=1e3).ravel(), prior])

    fitted = least_squares(residuals, start, x_scale=scale, loss="soft_l1", max_nfev=60)
    return parts(fitted.x)
