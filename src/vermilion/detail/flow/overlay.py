"""A checkerboard on the face: drift shows as squares that move over the skin."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.imaging.draw import label, tile, to_display
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_spaced
from vermilion.tracking.overlay import crop_to_points

_SQUARES = 40
_OPACITY = 0.45


def draw_checkerboard(
    image: np.ndarray, camera: Camera, vertices_mm: np.ndarray, model: FaceModel
) -> np.ndarray:
    """A copy of an image with the face in squares of the model's texture coordinates.

    Args:
        image: (h, w, 3) uint8.
        camera: of the image.
        vertices_mm: (V, 3), world.
        model: topology and texture coordinates.

    Returns:
        (h, w, 3) uint8.
    """
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
    """Some frames, a row each: the image, the coarse mesh, the corrected mesh; (h, w, 3) uint8.

    Args:
        read_image: frame -> image (h, w, 3), linear RGB, or InputError.
        camera: of the images.
        model: topology and texture coordinates.
        frames: (F,) numbers.
        before_mm: (F, V, 3) coarse meshes, world.
        after_mm: (F, V, 3) corrected meshes, world.
        count: frames to show, at most.
    """
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
