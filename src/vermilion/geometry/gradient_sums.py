"""Sums over the deformation gradients of a mesh, without the gradients.

The gradient of triangle t is S_t = [v2 - v1, v3 - v1, n_t] R_t, with R_t the inverse of the frame at rest and n_t the
offset of the phantom vertex (Sumner and Popovic 2004). So a sum of gradients with fixed weights is a fixed linear
map of the vertices and of the n_t: one sparse product a pose, whatever is summed.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.geometry.deformation_gradients import inverse_3x3, triangle_frames
from vermilion.geometry.vertex_normals import crosses_by_axis


class GradientSums:
    """N sums of columns of the gradients, and of what is linear in the vertices themselves."""

    def __init__(
        self,
        rest_mm: np.ndarray,
        triangles: np.ndarray,
        of_gradients: sparse.sparray | sparse.spmatrix,
        of_vertices: sparse.sparray | sparse.spmatrix,
    ):
        """Prepare.

        Args:
            rest_mm: (V, 3) where all gradients are the identity.
            triangles: (T, 3).
            of_gradients: (N, 3 T), at 3 t + j the weight of column j of the gradient of triangle t. A triangle that
                has no area at rest keeps the identity.
            of_vertices: (N, V).
        """
        self._triangles = triangles.astype(np.int64)
        inverse = inverse_3x3(triangle_frames(np.asarray(rest_mm, np.float64), triangles))
        flat = np.isnan(inverse).any(axis=(1, 2))
        inverse[flat] = 0.0
        of_frames = sparse.csc_array(of_gradients @ _blocks(inverse))
        of_edges = of_frames[:, 0::3], of_frames[:, 1::3]
        vertices = sparse.csr_array(of_vertices)
        for k, weights in enumerate(of_edges, start=1):
            vertices = vertices + weights @ _differences(self._triangles, k, len(rest_mm))
        self._matrix = sparse.csr_array(sparse.hstack([vertices, of_frames[:, 2::3]]))
        kept = np.repeat(flat, 3)[:, None] * np.tile(np.eye(3), (len(triangles), 1))
        self._constant = of_gradients @ kept

    def of(self, pose_mm: np.ndarray) -> np.ndarray:
        """The sums (N, 3) of a pose_mm (V, 3)."""
        known = np.concatenate([pose_mm, phantom_offsets(pose_mm, self._triangles)])
        return self._matrix @ known + self._constant


def turned_by(triangle: np.ndarray, vectors: np.ndarray, n_triangles: int) -> sparse.csr_array:
    """Weights (N, 3 T) that give vectors (N, 3), each times the gradient of its triangle (N,)."""
    rows, columns = np.repeat(np.arange(len(triangle)), 3), 3 * triangle[:, None] + np.arange(3)
    shape = (len(triangle), 3 * n_triangles)
    return sparse.csr_array((vectors.ravel(), (rows, columns.ravel())), shape=shape)


def phantom_offsets(vertices_mm: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Offsets (T, 3) of the phantom vertices of triangles (T, 3): the third column of `triangle_frames`."""
    normals = crosses_by_axis(vertices_mm, triangles)
    length = np.sqrt((normals * normals).sum(axis=0))
    return np.divide(normals, np.sqrt(length), out=np.zeros_like(normals), where=length > 0).T


def _blocks(inverse: np.ndarray) -> sparse.csr_array:
    """(3 T, 3 T) block-diagonal of inverse (T, 3, 3), transposed: weights of gradients to those of frames."""
    # S[:, j] = sum_k F[:, k] R[k, j]
    count = len(inverse)
    place = np.arange(count + 1)
    swapped = np.ascontiguousarray(np.swapaxes(inverse, 1, 2))
    return sparse.csr_array(sparse.bsr_array((swapped, place[:-1], place), shape=(3 * count,) * 2))


def _differences(triangles: np.ndarray, corner: int, n_vertices: int) -> sparse.csr_array:
    """(T, V): corner k of each of the triangles (T, 3) minus its first."""
    count = len(triangles)
    rows, ones = np.tile(np.arange(count), 2), np.ones(count)
    columns = np.concatenate([triangles[:, corner], triangles[:, 0]])
    values = np.concatenate([ones, -ones])
    return sparse.csr_array((values, (rows, columns)), shape=(count, n_vertices))
