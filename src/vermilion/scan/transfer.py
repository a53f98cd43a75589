"""Deformation transfer between two meshes of one topology (Sumner and Popovic 2004).

With S_t the gradient that takes triangle t of the source's reference to a source pose, and c the
target's reference, the target's pose x minimises

    sum_t sum_(ij in t) w_ij |(x_i - x_j) - S_t (c_i - c_j)|^2  +  sum_i h_i |x_i - c_i - d_i|^2

with cotangent weights w of c. The second term only says where the mesh lies, as gradients do not: it
holds vertices that hardly move with any expression at their source displacement d. Where the two
references agree, so do the poses.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.geometry.cotangents import cotangents
from vermilion.geometry.deformation_gradients import deformation_gradients
from vermilion.geometry.sparse import CholeskyFactor

_HELD, _LOOSE = 1e-2, 1e-8


class DeformationTransfer:
    """Carries poses of one person to another; factors once.

    Args:
        source_mm, target_mm: (V, 3) the same pose of both people.
        triangles: (T, 3).
        held: (V,) bool, what hardly moves; every loose part should have some.
    """

    def __init__(
        self,
        source_mm: np.ndarray,
        target_mm: np.ndarray,
        triangles: np.ndarray,
        held: np.ndarray,
    ):
        """Factor for source_mm and target_mm (V, 3), triangles (T, 3), held (V,)."""
        self.source_mm = np.asarray(source_mm, dtype=np.float64)
        self.target_mm = np.asarray(target_mm, dtype=np.float64)
        self.triangles = triangles
        ends = np.stack([triangles[:, [1, 2, 0]].ravel(), triangles[:, [2, 0, 1]].ravel()])
        edges = np.arange(ends.shape[1])
        shape = (len(edges), len(self.target_mm))
        ones = np.ones(len(edges))
        self._difference = sparse.csr_matrix((ones, (edges, ends[0])), shape=shape)
        self._difference -= sparse.csr_matrix((ones, (edges, ends[1])), shape=shape)
        self._weighted = sparse.diags_array(cotangents(self.target_mm, triangles).ravel())
        self._weighted = (self._weighted @ self._difference).T.tocsr()
        stiffness = self._weighted @ self._difference
        self._hold = np.where(held, _HELD, _LOOSE) * stiffness.diagonal().mean()
        self._factor = CholeskyFactor(sparse.csc_matrix(stiffness + sparse.diags_array(self._hold)))

    def transfer(self, poses_mm: np.ndarray) -> np.ndarray:
        """The target's poses (E, V, 3) mm of the source's poses_mm (E, V, 3)."""
        gradients = deformation_gradients(self.source_mm, poses_mm, self.triangles)
        edges = (self._difference @ self.target_mm).reshape(-1, 3, 3)
        wanted = np.einsum("etij,tkj->tkei", gradients, edges)
        places = self.target_mm[:, None] + np.swapaxes(poses_mm - self.source_mm, 0, 1)
        right = self._weighted @ wanted.reshape(len(edges) * 3, -1)
        right += (self._hold[:, None, None] * places).reshape(len(places), -1)
        solved = self._factor.solve(right).reshape(len(places), -1, 3)
        return np.swapaxes(solved, 0, 1)
