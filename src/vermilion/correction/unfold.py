"""Folds of the lips taken out: where a layer turned triangles over, the base track's surface is carried along.

Layers of slivers at the corners of the mouth mean little, and contours are not seen there. A fold is a
displacement that changes too quickly: round it, the base track's own surface, which does not fold there, is laid
on the corrected surface rigidly, and what is left of the displacement is spread evenly from the surroundings.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from vermilion.correction.folds import LipFolds
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.mesh import adjacency

#: Rings of vertices round a fold that are made anew, more each round until nothing folds.
_RINGS = (1, 2, 3, 4, 6, 8)
_LEAST_AROUND = 4


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

    def unfold(self, corrected_mm: np.ndarray, base_mm: np.ndarray) -> np.ndarray:
        """A corrected mesh (V, 3) without the folds that the base track's (V, 3) does not have, same frame."""
        best, folded = corrected_mm, self._folds.folded_triangles(corrected_mm, base_mm)
        for carried_mm in (base_mm, self._neutral_mm):
            result, left = best, folded
            for rings in _RINGS:
                if not len(left):
                    return result
                result = result.copy()
                for inside in self._patches(np.unique(self._triangles[left]), rings):
                    self._replace(result, carried_mm, inside)
                left = self._folds.folded_triangles(result, base_mm)
                if len(left) < len(folded):
                    best, folded = result, left
        return best

    def _patches(self, vertices: np.ndarray, rings: int) -> list[np.ndarray]:
        """Connected patches of vertices (n,) within so many rings of some."""
        chosen = np.zeros(self._neighbours.shape[0], dtype=bool)
        chosen[vertices] = True
        for _ in range(rings):
            chosen |= self._neighbours @ chosen.astype(float) > 0
        ids = np.flatnonzero(chosen)
        count, label = csgraph.connected_components(self._neighbours[ids][:, ids], directed=False)
        return [ids[label == k] for k in range(count)]

    def _replace(self, mesh_mm: np.ndarray, shape_mm: np.ndarray, inside: np.ndarray) -> None:
        """The vertices `inside` (n,) of a mesh (V, 3) made anew from another's shape (V, 3), in place."""
        near = np.flatnonzero(self._neighbours[inside].sum(axis=0))
        around = np.setdiff1d(near, inside)
        if len(around) < _LEAST_AROUND:
            return
        laid = similarity_alignment(shape_mm[around], mesh_mm[around], scale=1.0)
        carried = laid.apply(shape_mm[np.concatenate([inside, around])])
        left = mesh_mm[around] - carried[len(inside) :]
        links = self._neighbours[inside][:, np.concatenate([inside, around])].toarray() > 0
        laplacian = np.diag(links.sum(axis=1)) - links[:, : len(inside)].astype(float)
        spread = np.linalg.solve(laplacian, links[:, len(inside) :].astype(float) @ left)
        mesh_mm[inside] = carried[: len(inside)] + spread
