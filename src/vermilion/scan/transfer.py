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
from vermilion.geometry.gradient_sums import GradientSums, turned_by
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
        source_mm, target_mm = (np.asarray(pose, np.float64) for pose in (source_mm, target_mm))
        ends = np.stack([triangles[:, [1, 2, 0]].ravel(), triangles[:, [2, 0, 1]].ravel()])
        edges, count = np.arange(ends.shape[1]), len(target_mm)
        shape = (len(edges), count)
        ones = np.ones(len(edges))
        difference = sparse.csr_matrix((ones, (edges, ends[0])), shape=shape)
        difference -= sparse.csr_matrix((ones, (edges, ends[1])), shape=shape)
        weighted = sparse.diags_array(cotangents(target_mm, triangles).ravel())
        weighted = (weighted @ difference).T.tocsr()
        stiffness = weighted @ difference
        hold = np.where(held, _HELD, _LOOSE) * stiffness.diagonal().mean()
        self._factor = CholeskyFactor(sparse.csc_matrix(stiffness + sparse.diags_array(hold)))
        of_edges = np.repeat(np.arange(len(triangles)), 3)
        turned = turned_by(of_edges, difference @ target_mm, len(triangles))
        self._right = GradientSums(
            source_mm, triangles, weighted @ turned, sparse.diags_array(hold)
        )
        self._places = hold[:, None] * (target_mm - source_mm)

    def transfer(self, poses_mm: np.ndarray) -> np.ndarray:
        """The target's poses (E, V, 3) mm of the source's poses_mm (E, V, 3)."""
        right = [self._right.of(pose) + self._places for pose in poses_mm]
        return np.stack([self._factor.solve(one) for one in right])
