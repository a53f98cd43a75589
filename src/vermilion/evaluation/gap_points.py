"""Between which points of a surface the gap of the lips is measured, the same way on any topology.

A lip's edge is round. The vertices of a coarse mesh that lie on it stand apart, so that the true surface
between them reaches further into the gap than they do, by 0.1 to 0.2 mm a lip on a tracker's mesh. So the gap
of the truth is taken from its own surface, not from the points that a coarse mesh has on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vermilion.evaluation.lips import column_of_x, lip_gaps
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import triangle_normals, unique_edges
from vermilion.geometry.surface_points import SurfacePoints

#: Parts that every edge is cut into: a column's lowest and highest points lie between vertices.
_PER_EDGE = 4
#: How far a point of another surface may lie from the face in the neutral (mm), and how it may turn.
_NEAR_MM, _MIN_COSINE = 3.0, 0.5


@dataclass(frozen=True)
class GapPoints:
    """Points on the edges of the lips of a surface.

    Attributes:
        points: N on the surface's edges.
        triangles: (U, 3) of the surface.
        sides: (N,) +1 upper lip, -1 lower.
        columns: (N,) of `lip_gaps`.
    """

    points: SurfacePoints
    triangles: np.ndarray
    sides: np.ndarray
    columns: np.ndarray

    @classmethod
    def of(cls, model: FaceModel) -> GapPoints:
        """Of a face model's own topology."""
        return cls._on_edges(model, model.triangles, _whole_sides(model), model.neutral_mm[:, 0])

    @classmethod
    def on(
        cls, model: FaceModel, rest_mm: np.ndarray, surface_mm: np.ndarray, triangles: np.ndarray
    ) -> GapPoints:
        """Of another surface of the same face, whose lips are known by the model's points on it.

        Args:
            model: V vertices.
            rest_mm: (V, 3) where the model's vertices lie on the surface in the neutral, mm; NaN where unknown.
            surface_mm: (S, 3) the surface in the neutral, the same world.
            triangles: (U, 3) of it.
        """
        known = np.isfinite(rest_mm).all(axis=1)[model.triangles].all(axis=1)
        own, surface = (
            model.triangles[known],
            Surface(np.nan_to_num(rest_mm), model.triangles[known]),
        )
        # By the triangles' middles: where lips touch, vertices lie on both.
        middles, normals = (
            surface_mm[triangles].mean(axis=1),
            triangle_normals(surface_mm, triangles),
        )
        found = surface.closest(middles, normals, _MIN_COSINE).within(_NEAR_MM)
        sides = np.where(found.bound, _whole_sides(model)[known][found.triangle], 0)
        corners = np.unique(triangles[sides != 0])
        x = np.zeros(len(surface_mm))
        x[corners] = surface.closest(surface_mm[corners]).sample(model.neutral_mm, own)[:, 0]
        return cls._on_edges(model, triangles, sides, x)

    @classmethod
    def _on_edges(
        cls, model: FaceModel, triangles: np.ndarray, sides: np.ndarray, x_mm: np.ndarray
    ) -> GapPoints:
        """Along the edges of the triangles with a side, at places across the mouth of the model's neutral."""
        parts = []
        for side in (1, -1):
            edges = unique_edges(triangles[sides == side])
            parts.append(np.column_stack([edges, np.full(len(edges), side)]))
        start, end, of_edge = np.repeat(np.concatenate(parts), _PER_EDGE + 1, axis=0).T
        share = np.tile(np.arange(_PER_EDGE + 1) / _PER_EDGE, len(start) // (_PER_EDGE + 1))
        points = SurfacePoints.on_edges(start, end, share, triangles)
        x = x_mm[start] + share * (x_mm[end] - x_mm[start])
        return cls(points, triangles, of_edge, column_of_x(model, x))

    def without(self, unknown: np.ndarray) -> GapPoints:
        """The same, points at `unknown` (V,) bool vertices left out."""
        of_corners = unknown[self.points.corners(self.triangles)] & (self.points.barycentric > 0)
        left_out = of_corners.any(axis=1)
        return replace(self, columns=np.where(left_out, -1, self.columns))

    def gaps(self, sequence_mm: np.ndarray, to_head: np.ndarray) -> np.ndarray:
        """Height of the gap in each column, (F, N_COLUMNS) mm.

        Args:
            sequence_mm: (F, S, 3) meshes, any world.
            to_head: (F, 3, 3), `points @ to_head` has the directions of the head frame.
        """
        used = self.columns >= 0
        points = self.points[used].sample(sequence_mm, self.triangles) @ to_head
        return lip_gaps(points, self.sides[used], self.columns[used])


def _whole_sides(model: FaceModel) -> np.ndarray:
    """(T,) side of the triangles whose corners all belong to one lip, a little of its inside with it."""
    of_corner = lip_sides(model, with_inside=True)[model.triangles]
    return np.where((of_corner == of_corner[:, :1]).all(axis=1), of_corner[:, 0], 0)
