"""Image of another tracker's topology with the labels that were transferred to it."""

from __future__ import annotations

import numpy as np

from vermilion.external.topology import ExternalTopology
from vermilion.geometry.camera import portrait_camera
from vermilion.imaging.draw import draw_points, draw_polyline, portrait, tile
from vermilion.scan.overlay import registration_panels

_SIZE_PX = 840
_COLOURS = {
    "rigid": (250, 230, 60),
    "vermilion_upper": (255, 130, 20),
    "vermilion_lower": (40, 200, 255),
}
_MOUTH_MARGIN = 0.35


def topology_overlay(found: ExternalTopology) -> np.ndarray:
    """(h, w, 3) uint8: the registration, the labels on the whole face and on the mouth alone."""
    model = found.model
    mouth = model.neutral_mm[np.concatenate([model.outer_contour, model.inner_contour])]
    middle, reach = mouth.mean(axis=0), np.ptp(mouth, axis=0).max()
    near = middle + (0.5 + _MOUTH_MARGIN) * reach * np.array([[-1.0, -1, 0], [1, 1, 0]])
    panels = [
        _labelled(found, model.neutral_mm[model.regions["face"]], "labels"),
        _labelled(found, near, "lips"),
    ]
    return np.concatenate([tile(registration_panels(found.made), 4), tile(panels, 2)], axis=0)


def _labelled(found: ExternalTopology, framed_mm: np.ndarray, title: str) -> np.ndarray:
    """A panel with regions, contours (red, green) and landmarks (blue), framed on some points (N, 3)."""
    model = found.model
    camera = portrait_camera(framed_mm, _SIZE_PX)
    image = portrait(camera, model.neutral_mm, model.triangles, title)
    for name, colour in _COLOURS.items():
        image = draw_points(image, camera.project(model.neutral_mm[model.regions[name]]), colour, 2)
    for loop, colour in (
        (model.outer_contour, (255, 40, 40)),
        (model.inner_contour, (40, 255, 40)),
    ):
        image = draw_polyline(
            image, camera.project(model.neutral_mm[np.append(loop, loop[0])]), colour
        )
    return draw_points(image, camera.project(model.neutral_mm[model.landmarks]), (60, 120, 255), 3)
