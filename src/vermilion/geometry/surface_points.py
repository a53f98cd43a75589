"""Points on a triangle mesh that move with it, and the search for the closest of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import Mesh, triangle_normals


@dataclass(frozen=True)
class SurfaceMap:
    """N points bound to a mesh.

    Attributes:
        triangle: (N,) int32 triangle of the mesh, -1 for a point that is bound to nothing.
        barycentric: (N, 3) float64 weights of the triangle's corners.
    """

    triangle: np.ndarray
    barycentric: np.ndarray

    @property
    def bound(self) -> np.ndarray:
        """(N,) bool."""
        return self.triangle >= 0

    def sample(self, values: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """Per-vertex `values` (..., V, D) at the points, (..., N, D) float64; NaN where unbound."""
        corners = triangles[np.maximum(self.triangle, 0)]
        points = sum(
            np.asarray(values[..., corners[:, k], :], np.float64) * self.barycentric[:, k, None]
            for k in range(3)
        )
        return np.where(self.bound[:, None], points, np.nan)

    def matrix(self, triangles: np.ndarray, n_vertices: int) -> sparse.csr_matrix:
        """(N, V) matrix that samples; rows of unbound points are zero."""
        rows = np.repeat(np.arange(len(self.triangle)), 3)
        columns = triangles[np.maximum(self.triangle, 0)].reshape(-1)
        data = (self.barycentric * self.bound[:, None]).reshape(-1)
        return sparse.csr_matrix((data, (rows, columns)), shape=(len(self.triangle), n_vertices))


def at_vertices(vertices: np.ndarray, triangles: np.ndarray) -> SurfaceMap:
    """Bind to mesh vertices (N,): each through some triangle that has it, its weight being 1."""
    flat = triangles.reshape(-1)
    order = np.argsort(flat, kind="stable")
    place = order[np.searchsorted(flat, vertices, sorter=order)]
    barycentric = np.zeros((len(vertices), 3))
    barycentric[np.arange(len(vertices)), place % 3] = 1.0
    return SurfaceMap((place // 3).astype(np.int32), barycentric)


def closest_on_surface(
    points_mm: np.ndarray,
    mesh: Mesh,
    *,
    normals: np.ndarray | None = None,
    max_angle_deg: float = 70.0,
    sides: np.ndarray | None = None,
    triangle_sides: np.ndarray | None = None,
    candidates: int = 32,
) -> tuple[SurfaceMap, np.ndarray]:
    """Closest point of a mesh for each of (N, 3) points, among compatible triangles.

    Args:
        normals: (N, 3) unit normals; a triangle whose normal differs by more than `max_angle_deg`
            is not compatible.
        sides, triangle_sides: (N,), (T,) in -1, 0, 1: lower lip, neither, upper lip; the two lips
            are not compatible.
        candidates: triangles looked at for each point, nearest centre first.

    Returns:
        (map, distance (N,) mm; unbound and infinite where no candidate is compatible).
    """
    triangles = mesh.triangles
    corners = mesh.vertices_mm[triangles]
    candidates = min(candidates, len(triangles))
    _, near = cKDTree(corners.mean(axis=1)).query(points_mm, k=candidates)
    near = near.reshape(len(points_mm), candidates)
    barycentric = closest_barycentric(points_mm[:, None], corners[near])
    found = (barycentric[..., None] * corners[near]).sum(axis=-2)
    distance = np.linalg.norm(found - points_mm[:, None], axis=-1)
    if normals is not None:
        facing = (triangle_normals(mesh.vertices_mm, triangles)[near] * normals[:, None]).sum(-1)
        distance[facing < np.cos(np.deg2rad(max_angle_deg))] = np.inf
    if sides is not None and triangle_sides is not None:
        distance[sides[:, None] * triangle_sides[near] < 0] = np.inf
    best = np.argmin(distance, axis=1)
    index = np.arange(len(points_mm))
    distance = distance[index, best]
    triangle = np.where(np.isfinite(distance), near[index, best], -1).astype(np.int32)
    return SurfaceMap(triangle, barycentric[index, best]), distance


def closest_barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights of the closest point of triangles, (..., 3); points (..., 3), corners (..., 3, 3).

    Ericson 2005, section 5.1.5, without branches: the plane's foot point where it lies inside,
    else the closest of the three edges' closest points.
    """
    a, b, c = (corners[..., k, :] for k in range(3))
    ab, ac, ap = b - a, c - a, points - a
    d00, d01, d11 = (ab * ab).sum(-1), (ab * ac).sum(-1), (ac * ac).sum(-1)
    d20, d21 = (ap * ab).sum(-1), (ap * ac).sum(-1)
    determinant = np.maximum(d00 * d11 - d01 * d01, 1e-300)
    v = (d11 * d20 - d01 * d21) / determinant
    w = (d00 * d21 - d01 * d20) / determinant
    inside = np.stack([1 - v - w, v, w], axis=-1)
    options, distances = [inside], [np.where((inside >= 0).all(-1), -1.0, np.inf)]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        start, along = corners[..., i, :], corners[..., j, :] - corners[..., i, :]
        length = np.maximum((along * along).sum(-1), 1e-300)
        t = np.clip(((points - start) * along).sum(-1) / length, 0, 1)
        weights = np.zeros_like(inside)
        weights[..., i], weights[..., j] = 1 - t, t
        options.append(weights)
        offset = start + t[..., None] * along - points
        distances.append((offset * offset).sum(-1))
    best = np.argmin(np.stack(distances, axis=-1), axis=-1)
    stacked = np.stack(options, axis=-2)
    return np.take_along_axis(stacked, best[..., None, None], axis=-2)[..., 0, :]
