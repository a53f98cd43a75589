"""Images of correction layers: coarse, accurate, and how strong the layer is in between."""

from __future__ import annotations

import numpy as np

from vermilion.correction.take_layers import TakeLayers
from vermilion.correspondence.correspondence import Correspondence
from vermilion.geometry.camera import portrait_camera
from vermilion.imaging.draw import colour_map, draw_mesh, label, tile
from vermilion.storage.frames import evenly_spaced

STRENGTH = 0.8  # length of nine numbers shown in the hottest colour


def layers_overlay(
    correspondence: Correspondence, made: TakeLayers, frames: list[int], n_shown: int = 3
) -> np.ndarray:
    """A row a frame, (h, w, 3) uint8: C, H on C's topology, strength of the layer on H."""
    camera = portrait_camera(correspondence.coarse_neutral_mm)
    grey = np.full((camera.height_px, camera.width_px, 3), 40, dtype=np.uint8)
    good = np.flatnonzero(made.valid)
    if not len(good):
        return label(grey, "no valid frame in this chunk")
    shown = good[evenly_spaced(len(good), n_shown)]
    triangles = correspondence.coarse_triangles
    bound = triangles[correspondence.vertices.bound[triangles].all(axis=1)]
    panels = []
    for row in shown:
        accurate = np.nan_to_num(made.accurate_mm[row])
        strength = _at_vertices(correspondence, np.linalg.norm(made.layers[row], axis=1))
        panels += [
            label(draw_mesh(grey, camera, made.coarse_mm[row], triangles), f"C, {frames[row]}"),
            label(draw_mesh(grey, camera, accurate, bound), "H on C"),
            label(
                draw_mesh(grey, camera, accurate, bound, colour_map(strength, 0.0, STRENGTH)),
                f"layer, 0 to {STRENGTH:g}",
            ),
        ]
    return tile(panels, 3)


def _at_vertices(correspondence: Correspondence, per_triangle: np.ndarray) -> np.ndarray:
    """Mean of the mask's triangles round each vertex, (V,); NaN outside the mask."""
    corners = correspondence.coarse_triangles[correspondence.mask].reshape(-1)
    n_vertices = len(correspondence.coarse_neutral_mm)
    total = np.bincount(corners, np.repeat(per_triangle, 3), minlength=n_vertices)
    count = np.bincount(corners, minlength=n_vertices)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
