"""Upper and lower lip as labels, so that the one never binds to the other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from vermilion.geometry.mesh import Mesh, unique_edges


def lip_sides(mesh: Mesh, regions: Mapping[str, np.ndarray]) -> np.ndarray:
    """1 on the upper lip, -1 on the lower, 0 elsewhere, (V,) int8.

    The inside of the mouth takes the side of the red that is nearer along the surface.

    Args:
        regions: names of `FaceModel.regions` -> (V,) bool.
    """
    upper, lower = regions["vermilion_upper"], regions["vermilion_lower"]
    sides = upper.astype(np.int8) - lower.astype(np.int8)
    inside = regions["mouth_inner"] & (sides == 0)
    if not (upper.any() and lower.any() and inside.any()):
        return sides
    mouth = upper | lower | inside
    edges = unique_edges(mesh.triangles)
    edges = edges[mouth[edges].all(axis=1)]
    lengths = np.linalg.norm(mesh.vertices_mm[edges[:, 0]] - mesh.vertices_mm[edges[:, 1]], axis=1)
    graph = sparse.csr_matrix((lengths, (edges[:, 0], edges[:, 1])), shape=(len(sides),) * 2)
    to_upper, to_lower = (
        csgraph.dijkstra(graph, directed=False, indices=np.flatnonzero(lip), min_only=True)
        for lip in (upper, lower)
    )
    nearer_upper = np.where(np.isfinite(to_upper) | np.isfinite(to_lower), to_upper < to_lower, 0)
    sides[inside] = np.where(nearer_upper[inside] > 0, 1, -1)
    sides[inside & ~np.isfinite(to_upper) & ~np.isfinite(to_lower)] = 0
    return sides
