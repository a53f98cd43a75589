"""Folds of the lips taken out: where a layer turned triangles over, the base track's surface is carried along.

Layers of slivers at the corners of the mouth mean little, and contours are not seen there. A fold is a
displacement that changes too quickly: round it, the mesh gets the differences along edges of the base track's
own surface, which does not fold there, turned as the mesh around is. How far round differs from frame to frame.
So what was made anew in a frame is made anew in its neighbours as well, the less the further off they are, and
the lips do not tremble.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from vermilion.correction.folds import LipFolds
from vermilion.geometry.mesh import adjacency

#: Rings of vertices round a fold that are made anew, more each round until nothing folds.
_RINGS = (1, 2, 3, 4, 6, 8)
#: Rings of vertices round what is made anew that say how it is turned, and how often their say is spread.
_AROUND, _SPREADS = 4, 30
#: A share this small is none: keeps what divides by shares and their rests finite.
_LEAST_SHARE = 1e-4


class Unfolder:
    """Takes folds out of the lips of a topology; build it once.

    Args:
        folds: which finds those of the topology.
        triangles: (T, 3) of the mesh.
        neutral_mm: (V, 3) of the person, any frame: carried along where the base track's own shape folds too.
    """

    def __init__(self, folds: LipFolds, triangles: np.ndarray, neutral_mm: np.ndarray):
        self._folds, self._triangles, self._neutral_mm = folds, triangles, neutral_mm
        self._neighbours = sparse.csr_matrix(adjacency(triangles, len(neutral_mm)))

    def unfold_over_time(
        self, corrected_mm: np.ndarray, base_mm: np.ndarray, frames: np.ndarray, reach: int
    ) -> np.ndarray:
        """Corrected meshes (F, V, 3) without the folds that the base track's do not have.

        Args:
            corrected_mm, base_mm: (F, V, 3) head frame.
            frames: (F,) frame numbers.
            reach: frames to either side in which what a frame made anew counts, too; 0: each by itself.
        """
        anew = [self.unfold(*pair) for pair in zip(corrected_mm, base_mm, strict=True)]
        if reach == 0 or not len(anew):
            return np.array(anew).reshape(corrected_mm.shape)
        touched = np.stack([(a != c).any(axis=1) for a, c in zip(anew, corrected_mm, strict=True)])
        apart = np.abs(np.subtract.outer(frames, frames)) / reach
        near = np.clip(2.0 - 2.0 * apart, 0.0, 1.0)
        near = near**2 * (3.0 - 2.0 * near)
        result = np.array(corrected_mm)
        for f in np.flatnonzero((near > 0) @ touched.any(axis=1)):
            share = (near[f][:, None] * touched).max(axis=0)
            result[f] = self.unfold(self._blended(corrected_mm[f], base_mm[f], share), base_mm[f])
        return result

    def unfold(self, corrected_mm: np.ndarray, base_mm: np.ndarray) -> np.ndarray:
        """A corrected mesh (V, 3) without the folds that the base track's (V, 3) does not have, same frame."""
        best, folded = corrected_mm, self._folds.folded_triangles(corrected_mm, base_mm)
        for carried_mm in (base_mm, self._neutral_mm):
            start, result, left = best, best, folded
            share = np.zeros(len(start))
            for rings in _RINGS:
                if not len(left):
                    return result
                share[self._rings_of(np.unique(self._triangles[left]), rings)] = 1.0
                result = self._blended(start, carried_mm, share)
                left = self._folds.folded_triangles(result, base_mm)
                if len(left) < len(folded):
                    best, folded = result, left
        return best

    def _blended(self, mesh_mm: np.ndarray, shape_mm: np.ndarray, share: np.ndarray) -> np.ndarray:
        """A mesh (V, 3) with its surface as another's (V, 3) where the share (V,) is 1, its own where it is 0.

        The differences along edges are the other's, turned as the mesh around is; the less the share of a vertex,
        the more its own place counts.
        """
        inside = np.flatnonzero(share)
        near = np.flatnonzero(self._rings_of(inside, _AROUND))
        links = self._neighbours[near][:, near]
        rotation = _local_rotations(shape_mm[near], mesh_mm[near], links, share[near])
        start, end = sparse.triu(links).nonzero()
        edge = (shape_mm[near[end]] - shape_mm[near[start]])[:, None]
        wanted = 0.5 * (edge @ rotation[start] + edge @ rotation[end])[:, 0]
        rows = np.arange(len(start))
        incidence = sparse.csr_matrix(
            (
                np.r_[-np.ones(len(rows)), np.ones(len(rows))],
                (np.r_[rows, rows], np.r_[start, end]),
            ),
            shape=(len(rows), len(near)),
        )
        own = (1.0 - share[near]) / np.maximum(share[near], _LEAST_SHARE)
        matrix = (incidence.T @ incidence + sparse.diags(own)).tocsc()
        result = np.array(mesh_mm)
        solution = splu(matrix).solve(incidence.T @ wanted + own[:, None] * mesh_mm[near])
        free = share[near] > 0
        result[near[free]] = solution[free]
        return result

    def _rings_of(self, vertices: np.ndarray, rings: int) -> np.ndarray:
        """(V,) bool: within so many rings of some vertices (n,)."""
        chosen = np.zeros(self._neighbours.shape[0], dtype=bool)
        chosen[vertices] = True
        for _ in range(rings):
            chosen |= self._neighbours @ chosen.astype(float) > 0
        return chosen


def _local_rotations(
    shape_mm: np.ndarray, mesh_mm: np.ndarray, links: sparse.csr_matrix, share: np.ndarray
) -> np.ndarray:
    """(n, 3, 3): how a shape (n, 3) must turn, as rows, to lie as a mesh (n, 3) does around each vertex.

    Args:
        links: (n, n) neighbours.
        share: (n,) of the mesh that is to be replaced, and so says little.
    """
    weight = (1.0 - share + _LEAST_SHARE)[:, None]
    products = (shape_mm[:, :, None] * mesh_mm[:, None]).reshape(-1, 9)
    moments = weight * np.concatenate([np.ones_like(weight), shape_mm, mesh_mm, products], axis=1)
    spread = sparse.eye(len(share)) + links
    spread = sparse.diags(1.0 / np.asarray(spread.sum(axis=1)).ravel()) @ spread
    for _ in range(_SPREADS):
        moments = spread @ moments
    moments /= moments[:, :1]
    covariance = moments[:, 7:].reshape(-1, 3, 3) - moments[:, 1:4, None] * moments[:, None, 4:7]
    left, _, right = np.linalg.svd(covariance)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right
