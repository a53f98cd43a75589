"""The tracked model over the images."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.imaging.draw import draw_mesh, draw_points, draw_polyline, label, shown_frame, tile
from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.frames import evenly_spaced
from vermilion.tracking.result import TrackedTake

_SIDE_PX = 480


def draw_tracked(
    image: np.ndarray, camera: Camera, vertices_mm: np.ndarray, model: FaceModel
) -> np.ndarray:
    """A copy of an image with the half-transparent mesh and its two lip contours.

    Args:
        image: (h, w, 3) uint8.
        camera: of the image.
        vertices_mm: (V, 3), world.
        model: topology and contours of the mesh.

    Returns:
        (h, w, 3) uint8. A camera with distortion gets the contours alone.
    """
    if not camera.is_pinhole:
        return _draw_outline(image, camera, vertices_mm, model)
    drawn = draw_mesh(image, camera, vertices_mm, model.triangles, opacity=0.5)
    return _draw_outline(drawn, camera, vertices_mm, model)


def _draw_outline(image, camera, vertices_mm, model):
    for loop in (model.outer_contour, model.inner_contour):
        image = draw_polyline(image, camera.project(vertices_mm[loop]), (255, 40, 40))
    return image


def tracking_overlay(
    source: FrameSource,
    model: FaceModel,
    fit: TrackedTake,
    frames: Sequence[int],
    vertices_mm: np.ndarray,
    landmarks: LandmarkTrack,
    count: int,
) -> np.ndarray:
    """Evenly spaced frames of a chunk, cropped to the face, with mesh, contours and landmarks.

    Args:
        source: images of the take.
        model: topology and contours of the meshes.
        fit: the take's track: the camera, and which frames are valid; the others are labelled "not tracked".
        frames: (F,) numbers.
        vertices_mm: (F, V, 3), world.
        landmarks: of these frames or more.
        count: frames to show, at most.

    Returns:
        (h, w, 3) uint8.
    """
    images, camera, valid = [], fit.camera, fit.valid[fit.index_of(frames)]
    rows = {int(frame): row for row, frame in enumerate(landmarks.frames)}
    for index in evenly_spaced(len(frames), count):
        frame = int(frames[index])
        image = shown_frame(source, camera.name, frame, (camera.width_px, camera.height_px))
        drawn = draw_tracked(image, camera, vertices_mm[index], model)
        if frame in rows:
            drawn = draw_points(drawn, landmarks.points_px[rows[frame]], (0, 255, 0), 1)
        crop = crop_to_points(drawn, camera.project(vertices_mm[index]))
        images.append(label(crop, f"{frame}" if valid[index] else f"{frame}: not tracked"))
    return tile(images, 3)


def crop_to_points(image: np.ndarray, points_px: np.ndarray, margin: float = 0.08) -> np.ndarray:
    """The square around points (N, 2) px of an image (h, w, 3), resized to (480, 480, 3).

    `margin` is a share of the square's side; black outside the image.
    """
    low, high = np.nanmin(points_px, axis=0), np.nanmax(points_px, axis=0)
    half = 0.5 * (1 + 2 * margin) * max(float((high - low).max()), 8.0)
    corner = 0.5 * (low + high) - half
    scale = _SIDE_PX / (2 * half)
    affine = np.array([[scale, 0, -corner[0] * scale], [0, scale, -corner[1] * scale]])
    return cv2.warpAffine(image, affine, (_SIDE_PX, _SIDE_PX), flags=cv2.INTER_AREA)
