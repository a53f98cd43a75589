"""Image of what the contour search found."""

from __future__ import annotations

import numpy as np

from vermilion.contours.region import MouthRegion
from vermilion.features.contour_features import FrameContours
from vermilion.imaging.draw import draw_points, draw_polyline, label, to_display

MODEL_COLOUR = (90, 160, 255)
OUTER_COLOUR, INNER_COLOUR, MISSING_COLOUR = (70, 255, 90), (255, 70, 60), (255, 0, 255)


def contours_overlay(
    image: np.ndarray, contours: FrameContours, frame: int, side_px: int = 320
) -> np.ndarray:
    """The mouth of an `image` (h, w, 3) linear RGB, (side, side, 3) uint8: the model's contours blue, found
    ones green and red, samples without a maximum magenta."""
    region = _region(contours, side_px)
    canvas = to_display(region.crop(image))
    for points in (contours.model_outer_px, contours.model_inner_px):
        canvas = draw_polyline(canvas, region.to_region(points), MODEL_COLOUR)
    for points, found, colour in (
        (contours.outer_px, contours.outer_found, OUTER_COLOUR),
        (contours.inner_px, contours.inner_found, INNER_COLOUR),
    ):
        points = region.to_region(points)
        canvas = draw_polyline(canvas, points, colour)
        canvas = draw_points(canvas, points[~found], MISSING_COLOUR, 2)
    return label(canvas, f"frame {frame}")


def _region(contours: FrameContours, side_px: int) -> MouthRegion:
    centre = contours.model_outer_px.mean(axis=0)
    scale = 0.95 * contours.interocular_px / side_px
    linear = scale * np.eye(2)
    affine = np.column_stack([linear, centre - linear @ np.full(2, side_px / 2)])
    nothing = np.zeros((0, 2))
    return MouthRegion(affine, side_px, nothing, nothing, np.ones((side_px, side_px), dtype=bool))
