"""A checkerboard that sticks to the face: drift shows as squares that swim on the skin."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.imaging.draw import label, tile, to_display
from vermilion.storage.errors import InputError
from vermilion.storage.evenly_spaced import evenly_spaced
from vermilion.tracking.overlay import crop_to_points

_SQUARES = 40
_OPACITY = 0.45


def draw_checkerboard(
    image: np.ndarray, camera: Camera, vertices_mm: np.ndarray, model: FaceModel
) -> np.ndarray:
    """A copy of (h, w, 3) uint8 with the face in squares of the model's texture coordinates."""
    hits = RayCaster(vertices_mm, model.triangles).see(camera)
    uv = interpolate(hits, model.triangles, model.uv.astype(np.float64))
    dark = np.floor(uv * _SQUARES).astype(int).sum(axis=2) % 2 == 1
    face = model.regions["face"][model.triangles].all(axis=1)[np.maximum(hits.triangle, 0)]
    colour = np.where(dark[..., None], np.array([30.0, 60, 160]), np.array([255.0, 240, 150]))
    opacity = (hits.hit & face)[..., None] * _OPACITY
    return np.rint(image * (1 - opacity) + colour * opacity).astype(np.uint8)


def checkerboard_sheet(
    read_image: Callable[[int], np.ndarray],
    camera: Camera,
    model: FaceModel,
    frames: Sequence[int],
    before_mm: np.ndarray,
    after_mm: np.ndarray,
    count: int,
) -> np.ndarray:
    """Some frames, a row each: the image, then the coarse (F, V, 3) and the corrected meshes."""
    tiles = []
    for index in evenly_spaced(len(frames), count):
        frame = int(frames[index])
        try:
            image = to_display(read_image(frame))
        except InputError:
            image = np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8)
        place = camera.project(before_mm[index])
        tiles.append(label(crop_to_points(image, place), f"{frame}"))
        for name, mesh in (("coarse", before_mm[index]), ("corrected", after_mm[index])):
            drawn = draw_checkerboard(image, camera, mesh, model)
            tiles.append(label(crop_to_points(drawn, place), f"{frame} {name}"))
    return tile(tiles, 3)
