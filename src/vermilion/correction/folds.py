"""Folds of the lips: where two triangles of one lip fold on each other and the base track's do not."""

from __future__ import annotations

import numpy as np

from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import normalised, triangle_cross


class LipFolds:
    """Finds folds of the lips of a topology; build it once.

    Args:
        face: the model that the mesh is of.
        folded_deg: two neighbours of one lip are folded whose normals are further apart, degrees, ...
        crease_deg: ... unless those of the base track are further apart than this: its own creases.
    """

    def __init__(self, face: FaceModel, folded_deg: float, crease_deg: float):
        one_lip = triangles_of_one_lip(lip_sides(face, with_inside=True), face.triangles)
        pairs = adjacent_triangles(face.triangles, np.flatnonzero(one_lip))
        self._ids, places = np.unique(pairs, return_inverse=True)
        self._pairs, self._triangles = places.reshape(pairs.shape), face.triangles[self._ids]
        self._folded, self._crease = np.cos(np.radians((folded_deg, crease_deg)))

    def folded_triangles(self, corrected_mm: np.ndarray, base_mm: np.ndarray) -> np.ndarray:
        """Ids (n,) of lip triangles that fold on a neighbour where the base track's do not.

        Args:
            corrected_mm, base_mm: (V, 3) meshes of one frame, mm; each in any frame.
        """
        now, before = (
            (normals[self._pairs[:, 0]] * normals[self._pairs[:, 1]]).sum(axis=1)
            for normals in (self._normals(corrected_mm), self._normals(base_mm))
        )
        found = self._pairs[(now < self._folded) & (before >= self._crease)]
        return self._ids[np.unique(found)]

    def _normals(self, vertices_mm: np.ndarray) -> np.ndarray:
        return normalised(triangle_cross(vertices_mm, self._triangles))


def triangles_of_one_lip(sides: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) bool of `triangles` (T, 3): all corners are of the same lip, by `sides` (V,) of `lip_sides`."""
    corners = sides[triangles]
    return (corners == corners[:, :1]).all(axis=1) & (corners[:, 0] != 0)


def adjacent_triangles(triangles: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Pairs (n, 2) of `chosen` (k,) triangle ids of `triangles` (T, 3) that share an edge."""
    edges = np.sort(triangles[chosen][:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    order = np.lexsort(edges.T)
    edges, owner = edges[order], np.repeat(chosen, 3)[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    return np.stack([owner[:-1][same], owner[1:][same]], axis=1)
