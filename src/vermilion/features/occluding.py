"""Which points of the lips form the inner contour in the image.

It is an occluding contour: as lips open and roll, the line that hides the mouth moves over their
surface, away from where they meet in the neutral (Lips16 section 6; Anderson et al. 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import unique_edges
from vermilion.geometry.surface_points import SurfacePoints

#: Parts that every edge is cut into.
_PER_EDGE = 4
#: Columns of the mouth in each of which the contour is one point.
_COLUMNS = 40
#: More than any image is high (px): columns are sorted by height together, one after the other.
_APART = 1e6


@dataclass(frozen=True)
class OccludingContour:
    """Points of the lips of a topology.

    Attributes:
        points: N on the lips and a little of their inside.
        sides: (N,) +1 upper lip, -1 lower.
        triangles: (T, 3) of the topology.
    """

    points: SurfacePoints
    sides: np.ndarray
    triangles: np.ndarray

    def on(self, vertices_mm: np.ndarray) -> np.ndarray:
        """The points (N, 3) on a mesh `vertices_mm` (V, 3) of the topology, in its frame, mm."""
        return self.points.sample(vertices_mm, self.triangles)

    @classmethod
    def of(cls, model: FaceModel, with_inside: bool = True) -> OccludingContour:
        """Points along every edge of the triangles that belong to one lip, `with_inside` a little of its inside.

        Extremes of a triangle lie on its edges.
        """
        sides = lip_sides(model, with_inside=with_inside)
        of_corner = sides[model.triangles]
        whole = (of_corner == of_corner[:, :1]).all(axis=1) & (of_corner[:, 0] != 0)
        start, end = unique_edges(model.triangles[whole]).T
        vertices = np.unique([start, end])
        share = np.arange(1, _PER_EDGE) / _PER_EDGE
        points = SurfacePoints.on_edges(
            np.concatenate([vertices, np.repeat(start, len(share))]),
            np.concatenate([vertices, np.repeat(end, len(share))]),
            np.concatenate([np.zeros(len(vertices)), np.tile(share, len(start))]),
            model.triangles,
        )
        of_points = np.concatenate([sides[vertices], np.repeat(sides[start], len(share))])
        return cls(points, of_points, model.triangles)

    def match(
        self, pixels: np.ndarray, outer_px: np.ndarray, inner_px: np.ndarray, known: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(inner samples, the points that form the contour there, up (2,)).

        In each column of the mouth, the lowest point of the upper lip and the highest of the lower.

        Args:
            pixels: (N, 2) projected points.
            outer_px, inner_px: (n, 2) found rings, sample 0 at the right corner, n / 2 at the left.
            known: (n,) bool, inner samples that are asked for; the corners never are.
        """
        half = len(outer_px) // 2
        along = outer_px[half] - outer_px[0]
        width = np.linalg.norm(along)
        along = along / max(width, 1e-9)
        up = np.array([-along[1], along[0]])
        up = up * np.sign(((outer_px[1:half] - outer_px[half + 1 :][::-1]) @ up).sum())
        column_px = max(width / _COLUMNS, 1e-9)
        place = (pixels - outer_px[0]) @ along / column_px
        column = np.floor(np.where(np.isfinite(place), place, -1e6)).astype(int)
        wanted = np.floor((inner_px - outer_px[0]) @ along / column_px)
        wanted = np.where(np.isfinite(wanted), wanted, -2e6).astype(int)
        height = pixels @ up
        samples, points = [], []
        upper, lower = np.arange(1, half), np.arange(half + 1, 2 * half)
        for side, of_side in ((1, upper), (-1, lower)):
            ids = np.flatnonzero(self.sides == side)
            order = ids[np.argsort(_APART * column[ids] + side * height[ids], kind="stable")]
            columns, first = np.unique(column[order], return_index=True)
            if not len(columns):
                continue
            asked = of_side[known[of_side]]
            at = np.minimum(np.searchsorted(columns, wanted[asked]), len(columns) - 1)
            there = columns[at] == wanted[asked]
            samples.append(asked[there])
            points.append(order[first[at[there]]])
        empty = np.zeros(0, dtype=int)
        return np.concatenate([empty, *samples]), np.concatenate([empty, *points]), up
