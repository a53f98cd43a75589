"""Points on a triangle mesh: a triangle and barycentric coordinates, so that they move with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse


@dataclass(frozen=True)
class SurfacePoints:
    """N points on a triangle mesh: the one convention, used by every room.

    Attributes:
        triangle: (N,) int, row of the mesh's triangles; -1 for a point that is bound to nothing.
        barycentric: (N, 3) float, weights of the triangle's corners; they sum to 1.
        distance_mm: (N,) float, mm to the query that was bound, infinite where unbound; None where
            the points were not found by a search.
    """

    triangle: np.ndarray
    barycentric: np.ndarray
    distance_mm: np.ndarray | None = None

    @classmethod
    def at_vertices(cls, vertices: np.ndarray, triangles: np.ndarray) -> SurfacePoints:
        """Bind to mesh vertices, each through some triangle that has it, with weight 1.

        Args:
            vertices: (N,) vertex ids, each of some triangle.
            triangles: (T, 3) of the mesh.

        Returns:
            N points.
        """
        flat = triangles.reshape(-1)
        order = np.argsort(flat, kind="stable")
        place = order[np.searchsorted(flat, vertices, sorter=order)]
        barycentric = np.zeros((len(vertices), 3))
        barycentric[np.arange(len(vertices)), place % 3] = 1.0
        return cls((place // 3).astype(np.int32), barycentric)

    @classmethod
    def on_edges(
        cls, start: np.ndarray, end: np.ndarray, fraction: np.ndarray, triangles: np.ndarray
    ) -> SurfacePoints:
        """Bind to mesh edges, each through some triangle that has it; the third weight is 0.

        Args:
            start, end: (N,) vertex ids of edges of the mesh; twice the same for a vertex.
            fraction: (N,) in [0, 1], the way from start to end.
            triangles: (T, 3) of the mesh.

        Returns:
            N points.
        """
        first = np.concatenate([triangles, triangles], axis=1).reshape(-1).astype(np.int64)
        second = np.concatenate([np.roll(triangles, -1, axis=1), triangles], axis=1).reshape(-1)
        count = int(triangles.max()) + 1
        keys = np.minimum(first, second) * count + np.maximum(first, second)
        order = np.argsort(keys, kind="stable")
        wanted = np.minimum(start, end).astype(np.int64) * count + np.maximum(start, end)
        triangle = order[np.searchsorted(keys, wanted, sorter=order)] // 6
        corners, rows = triangles[triangle], np.arange(len(triangle))
        barycentric = np.zeros((len(triangle), 3))
        barycentric[rows, (corners == np.asarray(end)[:, None]).argmax(axis=1)] = fraction
        barycentric[rows, (corners == np.asarray(start)[:, None]).argmax(axis=1)] += 1 - fraction
        return cls(triangle.astype(np.int32), barycentric)

    @property
    def bound(self) -> np.ndarray:
        """(N,) bool: points that lie on a triangle."""
        return self.triangle >= 0

    def __len__(self) -> int:
        return len(self.triangle)

    def __getitem__(self, rows: np.ndarray | slice) -> SurfacePoints:
        distance = None if self.distance_mm is None else self.distance_mm[rows]
        return SurfacePoints(self.triangle[rows], self.barycentric[rows], distance)

    def restricted(self, kept: np.ndarray) -> SurfacePoints:
        """The same points, unbound where they are not `kept` (N,) bool."""
        distance = self.distance_mm
        return replace(
            self,
            triangle=np.where(kept, self.triangle, -1),
            distance_mm=None if distance is None else np.where(kept, distance, np.inf),
        )

    def within(self, reach_mm: float) -> SurfacePoints:
        """The same points, unbound where a search found them farther than `reach_mm` from the query.

        Raises ValueError for points that no search found.
        """
        if self.distance_mm is None:
            raise ValueError("points without a distance: give those of Surface.closest")
        return self.restricted(self.distance_mm <= reach_mm)

    def corners(self, triangles: np.ndarray) -> np.ndarray:
        """Ids (N, 3) of the vertices between which the points lie, by the mesh's triangles (T, 3).

        Those of triangle 0 where unbound.
        """
        return triangles[np.maximum(self.triangle, 0)]

    def vertices(self, triangles: np.ndarray) -> np.ndarray:
        """Ids (n,), ascending, of the vertices with a weight in any point, by triangles (T, 3)."""
        carried = self.bound[:, None] & (self.barycentric > 0)
        return np.unique(self.corners(triangles)[carried])

    def sample(self, values: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """Values of vertices, interpolated at the points.

        Args:
            values: (..., V, D), of whatever unit and frame.
            triangles: (T, 3) of the mesh.

        Returns:
            (..., N, D) float64; NaN where unbound.
        """
        corners = self.corners(triangles)
        points = sum(
            np.asarray(values[..., corners[:, k], :], np.float64) * self.barycentric[:, k, None]
            for k in range(3)
        )
        return np.where(self.bound[:, None], points, np.nan)

    def matrix(self, triangles: np.ndarray, n_vertices: int) -> sparse.csr_matrix:
        """Sparse matrix (N, V) that samples values of vertices, by the mesh's triangles (T, 3).

        Rows of unbound points are zero.
        """
        rows = np.repeat(np.arange(len(self)), 3)
        columns = self.corners(triangles).reshape(-1)
        data = (self.barycentric * self.bound[:, None]).reshape(-1)
        return sparse.csr_matrix((data, (rows, columns)), shape=(len(self), n_vertices))
