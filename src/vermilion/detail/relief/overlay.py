"""Images of the relief: frame, smooth mesh, mesh with relief, remaining error."""

from __future__ import annotations

import numpy as np

from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import colour_map, draw_mesh, label, to_display
from vermilion.tracking.overlay import crop_to_points

_WORST = 40.0  # display values at the hottest colour


def relief_panels(
    name: str,
    image: np.ndarray,
    camera: Camera,
    topology: FineTopology,
    smooth_mm: np.ndarray,
    refined_mm: np.ndarray,
    errors: np.ndarray,
) -> list[np.ndarray]:
    """Four panels (480, 480, 3) uint8 of a frame.

    Args:
        name: of the frame.
        image: (h, w, 3) linear RGB.
        camera: of the image.
        topology: of the fine meshes.
        smooth_mm: (V', 3) smooth mesh, world.
        refined_mm: (V', 3) mesh with relief, world.
        errors: (Q,) of the skin's triangles, display values (dark 0, red 40); NaN is grey.
    """
    shown, place = to_display(image), camera.project(refined_mm)
    of = np.full(len(topology.triangles), -1)
    of[topology.skin_of] = np.arange(len(topology.skin_of))
    hits = RayCaster(refined_mm, topology.triangles).see(camera)
    which = np.where(hits.hit, of[np.maximum(hits.triangle, 0)], -1)
    heat = np.rint(255 * colour_map(errors, 0.0, _WORST))[which]
    left = np.where((which >= 0)[..., None], heat, shown).astype(np.uint8)
    panels = [
        (name, shown),
        ("smooth", draw_mesh(shown, camera, smooth_mm, topology.triangles)),
        ("refined", draw_mesh(shown, camera, refined_mm, topology.triangles)),
        ("left over", left),
    ]
    return [label(crop_to_points(panel, place), text) for text, panel in panels]
