"""A refined frame over its image: the strokes, and the lips' contours before and after."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.guided.curves import mouth_axes
from vermilion.guided.silhouette import ContourSurface, Segments, inner_silhouettes, outer_contours
from vermilion.guided.sketch import Sketch
from vermilion.imaging.draw import draw_points, label

BEFORE, AFTER, STROKE = (230, 70, 60), (70, 220, 90), (255, 225, 60)
_SIDE_PX = 480
_MARGIN = 0.6  # of the contours' extent


def draw_refinement(
    image: np.ndarray,
    camera: Camera,
    surface: ContourSurface,
    before_mm: np.ndarray,
    after_mm: np.ndarray,
    sketch: Sketch | None = None,
) -> np.ndarray:
    """The mouth of an image with its strokes (yellow) and contours before (red) and after (green).

    Args:
        image: (h, w, 3) uint8 sRGB, of the camera.
        camera: world as the meshes.
        surface: of the topology.
        before_mm, after_mm: (V, 3) meshes, world.
        sketch: of the image; None for a sculpted frame.

    Returns:
        (480, 480, 3) uint8.
    """
    strokes = [] if sketch is None else [curve.points_px for curve in sketch.curves.values()]
    up = mouth_axes(strokes)[1] if strokes else np.array([0.0, -1.0])
    contours = [
        [
            *inner_silhouettes(vertices, surface, camera, up),
            *outer_contours(vertices, surface, camera),
        ]
        for vertices in (before_mm, after_mm)
    ]
    seen = [np.concatenate([s.start_px, s.end_px]) for group in contours for s in group]
    corner, scale = _window(np.concatenate([*seen, *strokes]))
    to_view = np.array([[scale, 0, -scale * corner[0]], [0, scale, -scale * corner[1]]])
    view = cv2.warpAffine(image, to_view, (_SIDE_PX, _SIDE_PX), flags=cv2.INTER_LINEAR)
    for points in strokes:
        view = draw_points(view, (points - corner) * scale, STROKE, 3)
    for group, colour in zip(contours, (BEFORE, AFTER), strict=True):
        view = _draw_segments(view, group, corner, scale, colour)
    return label(view, "stroke yellow, before red, after green")


def _window(points_px: np.ndarray) -> tuple[np.ndarray, float]:
    """Corner (2,) px of a square round points (n, 2), and its scale in the view."""
    if len(points_px) == 0:
        return np.zeros(2), 1.0
    low, high = points_px.min(axis=0), points_px.max(axis=0)
    side = max((1 + _MARGIN) * (high - low).max(), 8.0)
    return (low + high - side) / 2, _SIDE_PX / side


def _draw_segments(
    view: np.ndarray,
    group: Sequence[Segments],
    corner: np.ndarray,
    scale: float,
    colour: tuple[int, int, int],
) -> np.ndarray:
    view = np.ascontiguousarray(view).copy()
    for segments in group:
        ends = np.stack([segments.start_px, segments.end_px], axis=1)
        lines = np.rint(((ends - corner) * scale - 0.5) * 16).astype(np.int32)
        cv2.polylines(view, list(lines), False, colour, 1, cv2.LINE_AA, 4)
    return view
