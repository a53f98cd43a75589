"""Which vertices and triangles are which lip: +1 the upper lip, -1 the lower, 0 neither."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vermilion.faces.contours import edge_graph, geodesic_distance
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh, adjacency

_INSIDE_RINGS = 2


def lip_sides(model: FaceModel, with_inside: bool = False) -> np.ndarray:
    """Side of each vertex by the regions of a face model.

    Args:
        model: V vertices.
        with_inside: the inside of the lips counts as well, two rings of vertices from the vermilion.

    Returns:
        (V,) int8: +1 upper vermilion, -1 lower, 0 elsewhere.
    """
    upper, lower = model.regions["vermilion_upper"], model.regions["vermilion_lower"]
    sides = np.where(lower, -1, upper).astype(np.int8)
    neighbours = adjacency(model.triangles, model.n_vertices)
    for _ in range(_INSIDE_RINGS if with_inside else 0):
        upper, lower = (neighbours @ (sides == side) > 0 for side in (1, -1))
        free = (sides == 0) & model.regions["mouth_inner"]
        sides = np.where(free, upper.astype(np.int8) - lower, sides)
    return sides


def lip_sides_by_distance(
    mesh: Mesh, regions: Mapping[str, np.ndarray], corner_mm: float = 0.0
) -> np.ndarray:
    """Side of each vertex of the lips and the whole inside of the mouth.

    A vertex belongs to the lip whose vermilion is nearer along the mouth's surface. Where both are
    as near, the inside is of the lower lip, the vermilion of neither.

    Args:
        mesh: the neutral, any frame, mm.
        regions: names of `FaceModel.regions` -> (V,) bool.
        corner_mm: vertices whose two distances differ by no more lie at the corners of the mouth,
            where the lips are one surface; they have no side.

    Returns:
        (V,) int8: +1 upper lip, -1 lower, 0 elsewhere.
    """
    upper, lower = regions["vermilion_upper"], regions["vermilion_lower"]
    if not (upper.any() and lower.any()):
        return upper.astype(np.int8) - lower.astype(np.int8)
    inside = regions["mouth_inner"]
    mouth = upper | lower | inside
    graph = edge_graph(mesh.vertices_mm, mesh.triangles)[mouth][:, mouth]
    to_upper, to_lower = (
        geodesic_distance(graph, np.flatnonzero(lip[mouth])) for lip in (upper, lower)
    )
    is_upper = to_upper + corner_mm < to_lower
    is_lower = to_lower + corner_mm < to_upper
    is_lower |= inside[mouth] & (to_lower + corner_mm == to_upper) & np.isfinite(to_lower)
    sides = np.zeros(len(mouth), dtype=np.int8)
    sides[mouth] = is_upper.astype(np.int8) - is_lower
    return sides


def triangle_sides(triangles: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Side of triangles (T, 3) by the sides (V,) of their corners, the more frequent one, (T,) int8."""
    return np.sign(sides[triangles].sum(axis=1)).astype(np.int8)
