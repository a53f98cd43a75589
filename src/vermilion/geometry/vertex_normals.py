"""Normals of a mesh in many poses: what does not change from pose to pose is made once."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.mesh import incidence, normalised


class VertexNormals:
    """Area-weighted unit normals of poses of one topology, as `vertex_normals` gives them."""

    def __init__(self, triangles: np.ndarray, n_vertices: int):
        """Prepare for triangles (T, 3) of n_vertices vertices."""
        self._triangles = triangles.astype(np.int64)
        self._round = incidence(triangles, n_vertices)

    def of(self, vertices: np.ndarray) -> np.ndarray:
        """Unit normals (V, 3) of a pose's vertices (V, 3), any unit; zero where there is no area."""
        crosses = np.ascontiguousarray(crosses_by_axis(vertices, self._triangles).T)
        return normalised(self._round @ crosses)


def crosses_by_axis(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """What `triangle_cross` gives of vertices (V, 3) and triangles (T, 3), as (3, T): a third of its time."""
    axes = np.ascontiguousarray(np.asarray(vertices, dtype=np.float64).T)
    first, second, third = triangles.T
    corner = axes.take(first, axis=1)
    (ax, ay, az), (bx, by, bz) = (
        axes.take(second, axis=1) - corner,
        axes.take(third, axis=1) - corner,
    )
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
