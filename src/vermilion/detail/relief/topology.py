"""The subdivided mesh of a take, and its skin: the part whose shading is compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.appearance.samples import skin
from vermilion.detail.relief.subdivision import loop_subdivision
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import boundary_edges, submesh, unique_edges

_BORDER_RINGS = 3


@dataclass(frozen=True)
class FineTopology:
    """Topology of a take's fine meshes; indices of the skin count its own vertices.

    Attributes:
        finer: (V', V) coarse to fine vertices.
        triangles: (T', 3) of the whole fine mesh.
        skin_ids: (S,) fine vertices of the skin.
        skin: (Q, 3) triangles of the skin, indices into `skin_ids`.
        skin_of: (Q,) rows of the same triangles in `triangles`.
        pairs: (P, 2) triangles of the skin that share an edge.
        edges: (E, 2) edges of the skin.
        beside: (S,) a fixed neighbour of each vertex, in the direction of its first tangent.
        border: (S,) bool, border of the skin.
    """

    finer: sparse.csr_matrix
    triangles: np.ndarray
    skin_ids: np.ndarray
    skin: np.ndarray
    skin_of: np.ndarray
    pairs: np.ndarray
    edges: np.ndarray
    beside: np.ndarray
    border: np.ndarray

    @classmethod
    def of(cls, model: FaceModel, levels: int, spacing_mm: float) -> FineTopology:
        """Topology of a face model; the skin is without eyes, mouth and the border of the mesh.

        Args:
            model: coarse.
            levels: most subdivisions.
            spacing_mm: edges of the skin that are longer are halved.
        """
        coarse = skin(model, _BORDER_RINGS)
        finer, triangles = loop_subdivision(
            model.neutral_mm, model.triangles, levels, spacing_mm, coarse
        )
        keep = finer @ coarse.astype(float) > 0.999
        return cls.of_mask(finer, triangles, keep)

    @classmethod
    def of_mask(
        cls, finer: sparse.csr_matrix, triangles: np.ndarray, keep: np.ndarray
    ) -> FineTopology:
        """Topology of fine `triangles` (T', 3) with the vertices `keep` (V',) bool as the skin."""
        ids, own = submesh(triangles, keep)
        edges = unique_edges(own)
        beside = np.zeros(len(ids), dtype=int)
        beside[edges[:, 1]] = edges[:, 0]
        beside[edges[:, 0]] = edges[:, 1]
        border = np.zeros(len(ids), dtype=bool)
        border[boundary_edges(own)] = True
        skin_of = np.flatnonzero(keep[triangles].all(axis=1))
        return cls(finer, triangles, ids, own, skin_of, _pairs(own), edges, beside, border)

    def refine(self, coarse_mm: np.ndarray) -> np.ndarray:
        """Smooth fine mesh (V', 3) of `coarse_mm` (V, 3)."""
        return self.finer @ np.asarray(coarse_mm, dtype=np.float64)

    def displaced(
        self, fine_mm: np.ndarray, normals: np.ndarray, along_mm: np.ndarray
    ) -> np.ndarray:
        """`fine_mm` (V', 3) with its skin moved by `along_mm` (S,) along `normals` (S, 3)."""
        moved = fine_mm.copy()
        moved[self.skin_ids] += along_mm[:, None] * normals
        return moved


def _pairs(triangles: np.ndarray) -> np.ndarray:
    """(P, 2) triangles on both sides of each inner edge."""
    corners = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    corners = np.sort(corners, axis=1)
    order = np.lexsort((corners[:, 1], corners[:, 0]))
    same = (corners[order][1:] == corners[order][:-1]).all(axis=1)
    of = order % len(triangles)
    return np.stack([of[:-1][same], of[1:][same]], axis=1)
