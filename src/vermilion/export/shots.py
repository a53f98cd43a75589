"""The overlay video of a stretch of a take, framed by the whole take's head motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vermilion.export.overlay import (
    Crop,
    crop_round,
    lip_colours,
    overlay_image,
    strips_following,
)
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.storage.errors import InputError
from vermilion.tracking.result import TrackedTake

_STRIP_HEIGHT = 0.55  # of its width


@dataclass(frozen=True)
class Framing:
    """What every frame of a take's overlay shows.

    Attributes:
        face: one crop for the whole take.
        strips: (F) crops that follow the lips, one a frame of the take.
        triangles: (T, 3) to draw; colours: (V, 3).
    """

    face: Crop
    strips: list[Crop]
    triangles: np.ndarray
    colours: np.ndarray


def framing(
    model: FaceModel,
    neutral_mm: np.ndarray,
    fit: TrackedTake,
    margin: float,
    height_px: int,
) -> Framing:
    """Crops from the neutral in every pose of the take, so that all chunks are framed alike.

    Args:
        neutral_mm: (V, 3) head frame.
        fit: poses and camera of the take.
        margin: round the face, as a share of its extent.
        height_px: of the face panel.
    """
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]

    def projected(vertices: np.ndarray) -> np.ndarray:
        rotation, translation_mm = fit.world_from_head_rotation, fit.world_from_head_translation_mm
        posed = neutral_mm[vertices] @ np.swapaxes(rotation, 1, 2) + translation_mm[:, None]
        pixels = fit.camera.project(posed)
        pixels[~fit.valid] = np.nan
        return pixels

    size = (fit.camera.width_px, fit.camera.height_px)
    outline = np.flatnonzero(model.regions["face"])[::7]
    face = crop_round(projected(outline), size, margin, height_px)
    width = face.size[0]
    strip = (width, 2 * round(width * _STRIP_HEIGHT / 2))
    strips = strips_following(projected(np.flatnonzero(lips)), 0.9, strip)
    return Framing(face, strips, *_surface(model))


def with_surface_of(view: Framing, model: FaceModel) -> Framing:
    """The same crops for meshes of another model's topology."""
    triangles, colours = _surface(model)
    return replace(view, triangles=triangles, colours=colours)


def _surface(model: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (T, 3) to draw and colours (V, 3) of a model."""
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    shown = model.regions["face"] | model.regions["mouth_inner"] | lips
    triangles = model.triangles[shown[model.triangles].all(axis=1)]
    return triangles, lip_colours(model.triangles, lips)


def overlay_frames(
    view: Framing,
    camera: Camera,
    read: Callable[[int], np.ndarray],
    frames: Sequence[int],
    rows: Sequence[int],
    valid: Sequence[bool],
    meshes: Sequence[tuple[str, np.ndarray]],
    opacity: float,
    name: str,
) -> Iterator[np.ndarray]:
    """Images of the overlay of some frames, (h, w, 3) uint8.

    Args:
        read: frame -> (h, w, 3) uint8 sRGB; an image that it cannot read (InputError) is black.
        frames: frame numbers; rows: their rows in the take; valid: whether they were tracked.
        meshes: (label, (F, V, 3) world mm) pairs of these frames.
        name: of the take, for the caption.
    """
    for index, (frame, row, tracked) in enumerate(zip(frames, rows, valid, strict=True)):
        try:
            image = read(frame)
        except InputError:
            image = np.zeros((camera.height_px, camera.width_px, 3), np.uint8)
        pairs = [(label, vertices[index] if tracked else None) for label, vertices in meshes]
        yield overlay_image(
            image, camera, [view.face, view.strips[row]], pairs, view.triangles, view.colours,
            opacity, f"{name}  frame {frame}",
        )  # fmt: skip
