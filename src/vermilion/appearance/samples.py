"""Places on the model's skin at which model and image are compared: the same in every frame."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import adjacency, boundary_edges, connected_parts, triangle_areas
from vermilion.geometry.surface_points import SurfacePoints


def sample_skin(model: FaceModel, spacing_mm: float, border_rings: int = 2) -> SurfacePoints:
    """Samples of the skin of the face, about `spacing_mm` apart on the mean face.

    Left out: the inside of the mouth, teeth, eyes, and `border_rings` rings of vertices along the
    mesh's border, where hair, collar and background begin.
    """
    keep = skin(model, border_rings)
    triangles = np.flatnonzero(keep[model.triangles].all(axis=1))
    areas = triangle_areas(model.neutral_mm, model.triangles[triangles])
    counts = np.maximum(np.rint(areas / spacing_mm**2).astype(int), 1)
    which = np.repeat(np.arange(len(triangles)), counts)
    order = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    return SurfacePoints(triangles[which].astype(np.int32), _spread(order, counts[which]))


def skin(model: FaceModel, border_rings: int) -> np.ndarray:
    """(V,) bool: the face's skin away from the mesh's outer border and out of the mouth."""
    regions = model.regions
    keep = regions["face"] & ~regions["mouth_inner"] & ~regions["teeth"] & ~regions["eyes"]
    border = np.zeros(model.n_vertices, dtype=bool)
    border[_longest_border(model)] = True
    neighbours = adjacency(model.triangles, model.n_vertices)
    for _ in range(border_rings - 1):
        border |= neighbours @ border > 0
    return keep & ~border


def _longest_border(model: FaceModel) -> np.ndarray:
    """Vertices of the border that goes round the face: eyes and mouth may be holes as well."""
    edges = boundary_edges(model.triangles)
    if len(edges) == 0:
        return np.zeros(0, dtype=int)
    part = connected_parts(edges, model.n_vertices)
    lengths = np.linalg.norm(model.neutral_mm[edges[:, 0]] - model.neutral_mm[edges[:, 1]], axis=1)
    longest = np.bincount(part[edges[:, 0]], weights=lengths).argmax()
    return np.unique(edges[part[edges[:, 0]] == longest])


def _spread(order: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Barycentric weights (N, 3) of the `order`-th of `counts` points of a triangle."""
    # A rank-1 lattice of the unit square (plastic number), folded into the triangle.
    lone = counts == 1
    u = np.mod(0.5 + 0.7548776662466927 * (order + 1), 1.0)
    v = np.mod(0.5 + 0.5698402909980532 * (order + 1), 1.0)
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    u, v = np.where(lone, 1 / 3, u), np.where(lone, 1 / 3, v)
    return np.stack([1 - u - v, u, v], axis=1)
