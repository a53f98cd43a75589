"""The capture rig of Lips16 figure 3, and the single camera of a `video` take."""

from __future__ import annotations

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
VIDEO_CAMERAS = ("cam",)
#: The pair that looks from in front; the first carries the contour labels.
FRONTAL_PAIR = ("face2", "face3")


def camera_names(role: str) -> tuple[str, ...]:
    """Cameras of a take of this role."""
    return MULTIVIEW_CAMERAS if role in ("tattoo", "plain") else VIDEO_CAMERAS


def lips16_rig(
    model: FaceModel,
    neutral_mm: np.ndarray,
    distance_mm: float,
    face_size_px: tuple[int, int],
    lip_size_px: tuple[int, int],
    face_view_mm: float,
    lip_view_mm: float,
) -> dict[str, Camera]:
    """Ten cameras aimed at the actor whose neutral (V, 3) is given; its head frame is the world.

    The views are heights that an image covers at the face and at the lips.
    """
    lips = lips_centre(model, neutral_mm)
    face = face_centre(model, neutral_mm)
    cameras = {}
    for angles, target, size, view in (
        (FACE_ANGLES_DEG, face, face_size_px, face_view_mm),
        (LIP_ANGLES_DEG, lips, lip_size_px, lip_view_mm),
    ):
        for name, (turn, height) in angles.items():
            cameras[name] = aimed_camera(name, target, turn, height, distance_mm, size, view)
    return cameras


def video_camera(
    model: FaceModel,
    neutral_mm: np.ndarray,
    distance_mm: float,
    size_px: tuple[int, int],
    view_mm: float,
    turn_deg: float = 0.0,
    height_deg: float = 2.0,
) -> dict[str, Camera]:
    """One camera in front of the face of a neutral `neutral_mm` (V, 3)."""
    target = face_centre(model, neutral_mm)
    camera = aimed_camera("cam", target, turn_deg, height_deg, distance_mm, size_px, view_mm)
    return {"cam": camera}


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
