"""Images of a personal model, to be looked at once a scan."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.camera import Camera, portrait_camera
from vermilion.imaging.draw import colour_map, draw_points, portrait, tile
from vermilion.scan.personal import PersonalModel

SCALE_MM = 2.0
EXPRESSIONS = ("jawOpen", "mouthSmile_L", "mouthPucker", "eyeBlink_L")
_SIZE_PX = 420


def registration_panels(made: PersonalModel) -> list[np.ndarray]:
    """Images (420, 420, 3) uint8: scan with landmarks, registered model, distances, neutral."""
    model = made.model
    on_model = made.registered.vertices_mm[model.landmarks]
    camera = _camera(made)
    scan = portrait(
        camera, made.scan.vertices_mm, made.scan.triangles, "scan, landmarks (blue: model's)"
    )
    scan = draw_points(scan, camera.project(made.fit.points_mm), (255, 70, 60), 3)
    scan = draw_points(scan, camera.project(on_model), (60, 160, 255), 2)
    colours = colour_map(np.where(made.met, made.distance_mm, np.nan), 0.0, SCALE_MM)
    title = f"distance, 0 to {SCALE_MM:g} mm; grey: no scan there"
    return [
        scan,
        portrait(camera, made.registered.vertices_mm, model.triangles, "registered"),
        portrait(camera, made.registered.vertices_mm, model.triangles, title, colours),
        portrait(camera, model.neutral_mm, model.triangles, "neutral"),
    ]


def scan_overlay(made: PersonalModel) -> np.ndarray:
    """(h, w, 3) uint8: the registration, and some transferred expressions."""
    model, panels, camera = made.model, registration_panels(made), _camera(made)
    for name in EXPRESSIONS:
        if name in model.expression_names:
            moved = model.expressions_mm[model.expression_names.index(name)]
            panels.append(portrait(camera, model.neutral_mm + moved, model.triangles, name))
    return tile(panels, 4)


def _camera(made: PersonalModel) -> Camera:
    return portrait_camera(made.registered.vertices_mm, _SIZE_PX)
