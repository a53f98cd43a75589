"""A corrected sequence of another tracker in that tracker's own world, axes, unit and polygons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vermilion.export.animation import Animation, HeadFrame
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.geometry.camera import Camera


@dataclass(frozen=True)
class MovedSequence:
    """A sequence (F, V, 3) that is moved frame by frame as it is read: rotation @ x + translation.

    Attributes:
        vertices_mm: (F, V, 3); memory-mapped where it is long.
        rotation: (3, 3).
        translation_mm: (3,).
    """

    vertices_mm: np.ndarray
    rotation: np.ndarray
    translation_mm: np.ndarray

    def __len__(self) -> int:
        return len(self.vertices_mm)

    def __getitem__(self, row: int) -> np.ndarray:
        """The vertices (V, 3) of a frame, float64."""
        return np.asarray(self.vertices_mm[row], np.float64) @ self.rotation.T + self.translation_mm


def in_own_frame(
    animation: Animation, placement: Placement, origin: Origin, own_polygons: bool = True
) -> Animation:
    """The animation as the tracker's files have it.

    Args:
        animation: in the world of the capture.
        placement: of the tracker's world in it.
        origin: axes, unit and polygons of the files.
        own_polygons: whether the mesh is the tracker's, and not the user's head.
    """
    turn = origin.axes @ placement.rotation.T
    move = -turn @ placement.translation_mm
    head = animation.head
    camera = animation.camera
    return replace(
        animation,
        vertices_mm=MovedSequence(animation.vertices_mm, turn, move),
        polygons=origin.polygons if own_polygons else animation.polygons,
        head=HeadFrame(turn @ head.rotation, head.translation_mm @ turn.T + move),
        unit_mm=origin.unit_mm,
        uv=None if own_polygons else animation.uv,
        camera=None if camera is None else _moved(camera, turn, move),
        up=origin.up,
    )


def _moved(camera: Camera, turn: np.ndarray, move: np.ndarray) -> Camera:
    """The same camera in a world that is turned and moved."""
    rotation = camera.rotation @ turn.T
    translation = camera.translation - rotation @ move
    return replace(camera, cam_from_world=np.column_stack([rotation, translation]))
