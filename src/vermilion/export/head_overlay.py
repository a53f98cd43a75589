"""Image of the user's head with our face model laid over it, to be looked at once a subject."""

from __future__ import annotations

import numpy as np

from vermilion.export.animation import NamedShapes
from vermilion.export.head_binding import HeadBinding
from vermilion.export.head_file import HeadFile
from vermilion.export.head_transfer import HeadTransfer
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, portrait_camera
from vermilion.geometry.closest_points import Surface
from vermilion.imaging.draw import (
    colour_map,
    draw_points,
    draw_polyline,
    portrait,
    tile,
)

_SIZE_PX, _SCALE_MM = 420, 1.0
_EXPRESSIONS = ("jawOpen", "mouthPucker", "mouthSmile_L")


def head_overlay(generic: FaceModel, head: HeadFile, binding: HeadBinding) -> np.ndarray:
    """(h, w, 3) uint8: head and landmarks, our mesh over it, distances, lips; neutral, expressions.

    The second row is the head as it follows our model; the last panel of each row is the mouth alone.
    """
    labels = binding.model
    near = Surface(binding.registered_mm, generic.triangles).closest(labels.neutral_mm)
    assert near.distance_mm is not None
    face = labels.regions["face"] | labels.regions["mouth_inner"]
    colours = colour_map(np.where(face, near.distance_mm, np.nan), 0.0, _SCALE_MM)
    camera = portrait_camera(binding.registered_mm, _SIZE_PX)
    mouth = _mouth_camera(labels)
    shown = portrait(camera, labels.neutral_mm, labels.triangles, "head, landmarks")
    shown = draw_points(
        shown, camera.project(labels.neutral_mm[labels.landmarks]), (60, 160, 255), 2
    )
    title = f"distance, 0 to {_SCALE_MM:g} mm; grey: no face"
    lips = portrait(mouth, labels.neutral_mm, labels.triangles, "contours of the lips")
    for loop, colour in (
        (labels.outer_contour, (255, 40, 40)),
        (labels.inner_contour, (40, 255, 40)),
    ):
        closed = labels.neutral_mm[np.append(loop, loop[0])]
        lips = draw_polyline(lips, mouth.project(closed), colour)
    panels = [
        shown,
        portrait(camera, binding.registered_mm, generic.triangles, "our mesh over it"),
        portrait(camera, labels.neutral_mm, labels.triangles, title, colours),
        lips,
        *_expressions(generic, head, binding, camera, mouth),
    ]
    return tile(panels, 4)


def _expressions(
    generic: FaceModel, head: HeadFile, binding: HeadBinding, camera: Camera, mouth: Camera
) -> list[np.ndarray]:
    weights = np.zeros((0, generic.n_expressions))
    shapes = NamedShapes(generic.expression_names, generic.expressions_mm, weights)
    transfer = HeadTransfer(head, binding, generic, generic.neutral_mm, shapes)
    triangles, panels = head.polygons.triangles, []
    names = [name for name in _EXPRESSIONS if name in generic.expression_names]
    for name, seen in [*((name, camera) for name in names), ("", mouth)]:
        on = np.array([float(shape == name) for shape in generic.expression_names])
        pose = transfer.pose(generic.vertices(None, on), on)
        title = name or "our neutral"
        panels.append(portrait(seen, pose, triangles, title))
    return panels


def _mouth_camera(labels: FaceModel) -> Camera:
    lips = labels.neutral_mm[labels.outer_contour]
    middle, reach = lips.mean(axis=0), np.ptp(lips, axis=0).max()
    return portrait_camera(middle + 0.7 * reach * np.array([[-1.0, -1, 0], [1, 1, 0]]), _SIZE_PX)
