"""Images of a personal model, to be looked at once a scan."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.camera import portrait_camera
from vermilion.imaging.draw import colour_map, draw_mesh, draw_points, label, tile
from vermilion.scan.personal import PersonalModel

SCALE_MM = 2.0
EXPRESSIONS = ("jawOpen", "mouthSmile_L", "mouthPucker", "eyeBlink_L")
_SIZE_PX, _GROUND = 420, 40


def scan_overlay(made: PersonalModel) -> np.ndarray:
    """(h, w, 3) uint8: scan, registered model, distances, neutral, some transferred expressions."""
    model = made.model
    camera = portrait_camera(made.registered.vertices_mm, _SIZE_PX)
    empty = np.full((_SIZE_PX, _SIZE_PX, 3), _GROUND, dtype=np.uint8)

    def portrait(vertices, triangles, name, colours=None):
        return label(draw_mesh(empty, camera, vertices, triangles, colours), name)

    scan = portrait(made.scan.vertices_mm, made.scan.triangles, "scan, landmarks (blue: model's)")
    scan = draw_points(scan, camera.project(made.fit.points_mm), (255, 70, 60), 3)
    on_model = made.registered.vertices_mm[model.landmarks]
    scan = draw_points(scan, camera.project(on_model), (60, 160, 255), 2)
    colours = colour_map(np.where(made.met, made.distance_mm, np.nan), 0.0, SCALE_MM)
    title = f"distance, 0 to {SCALE_MM:g} mm; grey: no scan there"
    panels = [
        scan,
        portrait(made.registered.vertices_mm, model.triangles, "registered"),
        portrait(made.registered.vertices_mm, model.triangles, title, colours),
        portrait(model.neutral_mm, model.triangles, "neutral"),
    ]
    for name in EXPRESSIONS:
        if name in model.expression_names:
            moved = model.expressions_mm[model.expression_names.index(name)]
            panels.append(portrait(model.neutral_mm + moved, model.triangles, name))
    return tile(panels, 4)
