"""Sparse symmetric positive definite systems: factor once, solve many times."""

from __future__ import annotations

import cholespy
import numpy as np
from scipy import sparse


class CholeskyFactor:
    """Sparse Cholesky factor of a symmetric positive definite matrix (N, N)."""

    def __init__(self, matrix: sparse.spmatrix):
        coo = sparse.csc_matrix(matrix).tocoo()
        self.size = coo.shape[0]
        self._solver = cholespy.CholeskySolverD(
            self.size,
            coo.row.astype(np.int32),
            coo.col.astype(np.int32),
            coo.data.astype(np.float64),
            cholespy.MatrixType.COO,
        )

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for right-hand sides (N, ...) at once; returns the same shape."""
        flat = np.ascontiguousarray(right.reshape(self.size, -1), dtype=np.float64)
        solution = np.zeros_like(flat)
        self._solver.solve(flat, solution)
        return solution.reshape(right.shape)


def cotangent_laplacian(
    vertices: np.ndarray, triangles: np.ndarray
) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Intrinsic (tufted) cotangent Laplacian, safe on bad triangles (Sharp and Crane 2020).

    Args:
        vertices: (V, 3), mm, any frame.
        triangles: (T, 3).

    Returns:
        Laplacian (V, V), positive semi-definite, and diagonal mass (V, V), mm2.
    """
    import robust_laplacian

    return robust_laplacian.mesh_laplacian(np.asarray(vertices, float), np.asarray(triangles))
