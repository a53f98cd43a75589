"""The capture rig of Lips16 figure 3, and the single camera of a `video` take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, look_at, pinhole

#: Turn about the vertical and height angle of each camera, degrees. Three stereo pairs on the face
#: (left, front, right), two on the lips (from above, from below).
FACE_ANGLES_DEG = {
    f"face{i}": (turn, 4.0) for i, turn in enumerate((-32.0, -22.0, -5.0, 5.0, 22.0, 32.0))
}
LIP_ANGLES_DEG = {
    "lip0": (-7.0, 15.0),
    "lip1": (7.0, 15.0),
    "lip2": (-7.0, -17.0),
    "lip3": (7.0, -17.0),
}
MULTIVIEW_CAMERAS = (*FACE_ANGLES_DEG, *LIP_ANGLES_DEG)
VIDEO_CAMERAS, VIDEO_ANGLES_DEG = ("cam",), (0.0, 2.0)
#: The pair that looks from in front; the first carries the contour labels.
FRONTAL_PAIR = ("face2", "face3")


@dataclass(frozen=True)
class RigSettings:
    """Where the cameras stand and what they see; the head frame of the actor's neutral is the world.

    Attributes:
        cameras: names of those of `MULTIVIEW_CAMERAS` that the rig has.
        camera_distance_mm: from what a camera looks at.
        face_size_px, lip_size_px, video_size_px: (width, height) of an image.
        face_view_mm, lip_view_mm, video_view_mm: height that an image covers there.
    """

    cameras: tuple[str, ...]
    camera_distance_mm: float
    face_size_px: tuple[int, int]
    lip_size_px: tuple[int, int]
    video_size_px: tuple[int, int]
    face_view_mm: float
    lip_view_mm: float
    video_view_mm: float


def camera_names(role: str, rig: Sequence[str]) -> tuple[str, ...]:
    """Cameras of a take of this role, where the rig has these."""
    return tuple(rig) if role in ("tattoo", "plain") else VIDEO_CAMERAS


def lips16_rig(
    model: FaceModel, neutral_mm: np.ndarray, settings: RigSettings
) -> dict[str, Camera]:
    """The rig's cameras, aimed at the actor whose neutral `neutral_mm` (V, 3) is given, head frame."""
    lips = lips_centre(model, neutral_mm)
    face = face_centre(model, neutral_mm)
    distance, cameras = settings.camera_distance_mm, {}
    for angles, target, size, view in (
        (FACE_ANGLES_DEG, face, settings.face_size_px, settings.face_view_mm),
        (LIP_ANGLES_DEG, lips, settings.lip_size_px, settings.lip_view_mm),
    ):
        for name, (turn, height) in angles.items():
            cameras[name] = aimed_camera(name, target, turn, height, distance, size, view)
    return {name: cameras[name] for name in settings.cameras}


def video_camera(
    model: FaceModel, neutral_mm: np.ndarray, settings: RigSettings
) -> dict[str, Camera]:
    """One camera in front of the face of a neutral `neutral_mm` (V, 3)."""
    target, distance = face_centre(model, neutral_mm), settings.camera_distance_mm
    size, view = settings.video_size_px, settings.video_view_mm
    return {"cam": aimed_camera("cam", target, *VIDEO_ANGLES_DEG, distance, size, view)}


def aimed_camera(
    name: str,
    target_mm: np.ndarray,
    turn_deg: float,
    height_deg: float,
    distance_mm: float,
    size_px: tuple[int, int],
    view_mm: float,
) -> Camera:
    """A pinhole camera that looks at a target and covers `view_mm` of height there.

    `target_mm` (3,) world; `turn_deg` about the vertical, `height_deg` above the horizon.
    """
    turn, height = np.radians(turn_deg), np.radians(height_deg)
    direction = np.array(
        [np.sin(turn) * np.cos(height), np.sin(height), np.cos(turn) * np.cos(height)]
    )
    pose = look_at(target_mm + distance_mm * direction, target_mm, np.array([0.0, 1.0, 0.0]))
    focal_px = size_px[1] * distance_mm / view_mm
    return pinhole(name, focal_px, size_px[0], size_px[1], pose)


def lips_centre(model: FaceModel, vertices_mm: np.ndarray) -> np.ndarray:
    """Middle of the vermilion border of `vertices_mm` (V, 3), (3,) mm."""
    return vertices_mm[model.outer_contour].mean(axis=0)


def face_centre(model: FaceModel, vertices_mm: np.ndarray) -> np.ndarray:
    """Between brows and chin of `vertices_mm` (V, 3), at the depth of the lips, (3,) mm."""
    points = vertices_mm[model.landmarks]
    top, bottom = points[17:27, 1].max() + 12.0, points[8, 1]
    return np.array([points[27, 0], 0.5 * (top + bottom), lips_centre(model, vertices_mm)[2]])
