"""Closest points of a triangle mesh, with conditions on the triangles that may be chosen."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import triangle_areas, triangle_normals
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.geometry.triangle_tree import TriangleTree

_FIRST_CANDIDATES, _CONDITIONAL_CANDIDATES = 8, 48
_SIZE_QUANTILES = (0.25, 0.5, 0.75, 0.9, 0.98)


class Surface:
    """A mesh prepared for closest-point queries.

    Triangles without area are left out.
    """

    def __init__(self, vertices_mm: np.ndarray, triangles: np.ndarray):
        """Prepare a mesh: vertices_mm (V, 3) in any frame, triangles (T, 3)."""
        vertices = np.asarray(vertices_mm, dtype=np.float64)
        kept = np.flatnonzero(triangle_areas(vertices, triangles) > 1e-9)
        self.ids = kept
        self.corners = np.ascontiguousarray(vertices[triangles[kept]])
        self.normals = triangle_normals(vertices, triangles[kept])

    @cached_property
    def _tree(self) -> TriangleTree:
        return TriangleTree(self.corners)

    @cached_property
    def _groups(self) -> list[tuple[np.ndarray, cKDTree, float]]:
        """Triangles of like size, a tree of their centroids, the largest distance of a corner from its."""
        centroids = self.corners.mean(axis=1)
        radii = np.linalg.norm(self.corners - centroids[:, None], axis=2).max(axis=1)
        # Candidates are searched for among triangles of like size: one large triangle in a tree of
        # small ones would make every candidate list long.
        order = np.argsort(radii, kind="stable")
        bounds = np.searchsorted(radii[order], np.quantile(radii, _SIZE_QUANTILES), side="right")
        groups = (members for members in np.split(order, np.unique(bounds)) if len(members))
        return [(rows, cKDTree(centroids[rows]), float(radii[rows].max())) for rows in groups]

    def closest(
        self,
        points_mm: np.ndarray,
        normals: np.ndarray | None = None,
        min_cosine: float = 0.5,
        sides: np.ndarray | None = None,
        triangle_sides: np.ndarray | None = None,
    ) -> SurfacePoints:
        """Closest point of the mesh to each query point, among the triangles that may be chosen.

        Without conditions the result is exact. Conditions are met among the 48 nearest triangles of
        each of up to six sizes, or not at all: such a point is unbound.

        Args:
            points_mm: (N, 3) queries in the mesh's frame, finite.
            normals: (N, 3) unit normals of the queries; only triangles count whose own makes a
                cosine of at least `min_cosine` with it.
            min_cosine: see `normals`.
            sides: (N,) lip of each query: +1 upper, -1 lower, 0 neither (see `faces.lips`).
            triangle_sides: (T,) the same of the mesh's triangles. A query of one lip is never bound
                to the other; 0 goes with either.

        Returns:
            N points with their distance_mm.
        """
        # A copy: the kernels are compiled once more for an array that is read-only.
        points = np.array(points_mm, dtype=np.float64, order="C")
        if len(self.ids) == 0:
            none = np.full(len(points), -1, np.int64)
            return SurfacePoints(none, np.zeros((len(points), 3)), np.full(len(points), np.inf))
        if normals is None and sides is None:
            triangle, barycentric, distance = self._tree.closest(points)
            return SurfacePoints(self.ids[triangle], barycentric, distance)
        from vermilion.geometry.closest_kernels import closest_of

        given = np.zeros((len(points), 3)) if normals is None else np.asarray(normals, float)
        cosine = -2.0 if normals is None else min_cosine
        wanted = np.zeros(len(points), np.int64) if sides is None else np.asarray(sides, np.int64)
        owned = np.zeros(len(self.ids), np.int64)
        if triangle_sides is not None:
            owned = np.asarray(triangle_sides, np.int64)[self.ids]
        best = np.full(len(points), np.inf)
        triangle, barycentric = np.full(len(points), -1, np.int64), np.zeros((len(points), 3))
        rows = [np.arange(len(points))] * len(self._groups)
        for most in (_FIRST_CANDIDATES, _CONDITIONAL_CANDIDATES):
            for index, (members, tree, radius) in enumerate(self._groups):
                k = min(most, len(members))
                if len(rows[index]) == 0:
                    continue
                away, near = tree.query(points[rows[index]], k=k)
                closest_of(
                    points, given, wanted, rows[index], members[near.reshape(-1, k)], self.corners,
                    self.normals, owned, cosine, best, triangle, barycentric,
                )  # fmt: skip
                # Those for which a triangle further down the list could be nearer.
                is_open = best[rows[index]] > away.reshape(-1, k)[:, -1] - radius
                rows[index] = rows[index][is_open & (k < len(members))]
        triangle[triangle >= 0] = self.ids[triangle[triangle >= 0]]
        return SurfacePoints(triangle, barycentric, best)


def closest_barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights of the point of each triangle that is closest to the query beside it.

    Args:
        points: (N, 3) queries, any unit and frame.
        corners: (N, 3, 3) corners of a triangle for each.

    Returns:
        (N, 3) barycentric weights (Ericson 2005, section 5.1.5).
    """
    from vermilion.geometry.closest_kernels import weights_of

    return weights_of(
        np.array(points, np.float64, order="C"), np.array(corners, np.float64, order="C")
    )
