"""Closest points of a triangle mesh, with conditions on the triangles that may be chosen."""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import triangle_areas, triangle_normals
from vermilion.geometry.surface_points import SurfacePoints

_FIRST_CANDIDATES = 2
_CONDITIONAL_CANDIDATES = 48
_SIZE_QUANTILES = (0.25, 0.5, 0.75, 0.9, 0.98)


class Surface:
    """A mesh prepared for closest-point queries; exact, by candidates of a k-d tree.

    Triangles without area are left out.
    """

    def __init__(self, vertices_mm: np.ndarray, triangles: np.ndarray):
        """Prepare a mesh: vertices_mm (V, 3) in any frame, triangles (T, 3)."""
        vertices = np.asarray(vertices_mm, dtype=np.float64)
        kept = np.flatnonzero(triangle_areas(vertices, triangles) > 1e-9)
        self.ids = kept
        self.corners = np.ascontiguousarray(vertices[triangles[kept]])
        self.normals = triangle_normals(vertices, triangles[kept])
        centroids = self.corners.mean(axis=1)
        radii = np.linalg.norm(self.corners - centroids[:, None], axis=2).max(axis=1)
        # Candidates are searched for among triangles of like size: one large triangle in a tree of
        # small ones would make every candidate list long.
        order = np.argsort(radii, kind="stable")
        bounds = np.searchsorted(radii[order], np.quantile(radii, _SIZE_QUANTILES), side="right")
        self._groups = []
        for members in np.split(order, np.unique(bounds)):
            if len(members):
                self._groups.append((members, cKDTree(centroids[members]), radii[members].max()))

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
        points = np.ascontiguousarray(points_mm, dtype=np.float64)
        given = np.zeros((len(points), 3)) if normals is None else np.asarray(normals, float)
        cosine = -2.0 if normals is None else min_cosine
        wanted = np.zeros(len(points), np.int64) if sides is None else np.asarray(sides, np.int64)
        owned = np.zeros(len(self.ids), np.int64)
        if triangle_sides is not None:
            owned = np.asarray(triangle_sides, np.int64)[self.ids]
        best = np.full(len(points), np.inf)
        triangle, barycentric = np.full(len(points), -1, np.int64), np.zeros((len(points), 3))

        def search(group: tuple, rows: np.ndarray, k: int) -> np.ndarray:
            """Try the k candidates of each row; returns the distance to the farthest centroid."""
            members, tree, _ = group
            far, near = tree.query(points[rows], k=k)
            near = members[near.reshape(len(rows), k)]
            _closest_of(
                points, given, wanted, rows, near, self.corners, self.normals, owned,
                cosine, best, triangle, barycentric,
            )  # fmt: skip
            return far.reshape(len(rows), k)[:, -1]

        if normals is not None or sides is not None:
            for group in self._groups:
                search(group, np.arange(len(points)), min(_CONDITIONAL_CANDIDATES, len(group[0])))
        else:
            self._search_exactly(search, best)
        triangle[triangle >= 0] = self.ids[triangle[triangle >= 0]]
        return SurfacePoints(triangle, barycentric, best)

    def _search_exactly(self, search: Callable, best: np.ndarray) -> None:
        """First a good bound from few candidates of every size, then what could be nearer still.

        `best` (N,) holds the distances that `search` has found.
        """
        everything = np.arange(len(best))
        start = [min(_FIRST_CANDIDATES, len(group[0])) for group in self._groups]
        reached = [search(g, everything, k) for g, k in zip(self._groups, start, strict=True)]
        for group, k, far in zip(self._groups, start, reached, strict=True):
            rows = everything
            while k < len(group[0]):
                open_rows = far < best[rows] + group[2]
                rows = rows[open_rows]
                if not len(rows):
                    break
                k = min(3 * k, len(group[0]))
                far = search(group, rows, k)


@numba.njit(cache=True)
def _closest_of(  # pragma: no cover - compiled
    points: np.ndarray, normals: np.ndarray, sides: np.ndarray, rows: np.ndarray,
    candidates: np.ndarray, corners: np.ndarray, face_normals: np.ndarray, face_sides: np.ndarray,
    min_cosine: float, best: np.ndarray, triangle: np.ndarray, barycentric: np.ndarray,
) -> None:  # fmt: skip
    """Keep in `best`, `triangle`, `barycentric` the nearest of the candidate triangles."""
    for index in range(len(rows)):
        row = rows[index]
        px, py, pz = points[row]
        nx, ny, nz = normals[row]
        least = best[row] ** 2
        for t in candidates[index]:
            if sides[row] != 0 and face_sides[t] != 0 and sides[row] != face_sides[t]:
                continue
            if min_cosine > -1.0:
                fx, fy, fz = face_normals[t]
                if nx * fx + ny * fy + nz * fz < min_cosine:
                    continue
            u, v, w = _project(px, py, pz, corners[t])
            dx = u * corners[t, 0, 0] + v * corners[t, 1, 0] + w * corners[t, 2, 0] - px
            dy = u * corners[t, 0, 1] + v * corners[t, 1, 1] + w * corners[t, 2, 1] - py
            dz = u * corners[t, 0, 2] + v * corners[t, 1, 2] + w * corners[t, 2, 2] - pz
            square = dx * dx + dy * dy + dz * dz
            if square < least:
                least = square
                best[row] = math.sqrt(square)
                triangle[row] = t
                barycentric[row, 0], barycentric[row, 1], barycentric[row, 2] = u, v, w


@numba.njit(cache=True, inline="always")
def _project(  # pragma: no cover - compiled
    px: float, py: float, pz: float, abc: np.ndarray
) -> tuple[float, float, float]:
    """Barycentric weights of the point of triangle abc nearest to p (Ericson 2005, 5.1.5)."""
    abx, aby, abz = abc[1, 0] - abc[0, 0], abc[1, 1] - abc[0, 1], abc[1, 2] - abc[0, 2]
    acx, acy, acz = abc[2, 0] - abc[0, 0], abc[2, 1] - abc[0, 1], abc[2, 2] - abc[0, 2]
    apx, apy, apz = px - abc[0, 0], py - abc[0, 1], pz - abc[0, 2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    bpx, bpy, bpz = px - abc[1, 0], py - abc[1, 1], pz - abc[1, 2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        v = d1 / (d1 - d3)
        return 1.0 - v, v, 0.0
    cpx, cpy, cpz = px - abc[2, 0], py - abc[2, 1], pz - abc[2, 2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        w = d2 / (d2 - d6)
        return 1.0 - w, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - w, w
    total = va + vb + vc
    return va / total, vb / total, vc / total


def closest_barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights of the point of each triangle that is closest to the query beside it.

    Args:
        points: (N, 3) queries, any unit and frame.
        corners: (N, 3, 3) corners of a triangle for each.

    Returns:
        (N, 3) barycentric weights (Ericson 2005, section 5.1.5).
    """
    return _closest_weights(
        np.ascontiguousarray(points, np.float64), np.ascontiguousarray(corners, np.float64)
    )


@numba.njit(cache=True)
def _closest_weights(  # pragma: no cover - compiled
    points: np.ndarray, corners: np.ndarray
) -> np.ndarray:
    """`closest_barycentric`, compiled."""
    weights = np.empty((len(points), 3))
    for row in range(len(points)):
        x, y, z = points[row]
        weights[row, 0], weights[row, 1], weights[row, 2] = _project(x, y, z, corners[row])
    return weights
