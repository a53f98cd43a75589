"""Polygons of a mesh as its author made them: triangles, quads and wider ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Polygons:
    """P polygons of any number of corners.

    Attributes:
        counts: (P,) int32, corners of each polygon.
        corners: (N,) int32, their vertices, polygon after polygon; N is the sum of `counts`.
    """

    counts: np.ndarray
    corners: np.ndarray

    @classmethod
    def of_triangles(cls, triangles: np.ndarray) -> Polygons:
        """The triangles (T, 3) as they are."""
        counts = np.full(len(triangles), 3, dtype=np.int32)
        return cls(counts, np.ascontiguousarray(triangles, dtype=np.int32).ravel())

    @classmethod
    def of_corners(cls, counts: np.ndarray, corners: np.ndarray, n_vertices: int) -> Polygons:
        """Polygons of `counts` (P,) and `corners` (N,) of any integer type, as a file has them.

        Raises:
            ValueError: a corner is none of the `n_vertices`, or a polygon has fewer than three.
        """
        if len(counts) and (counts.min() < 3 or counts.sum() != len(corners)):
            raise ValueError("a face of fewer than three corners, or corners of no face")
        if len(corners) and (corners.min() < 0 or corners.max() >= n_vertices):
            raise ValueError(f"a face with a vertex beyond the {n_vertices} there are")
        return cls(counts.astype(np.int32), corners.astype(np.int32))

    @classmethod
    def with_quads(cls, triangles: np.ndarray) -> Polygons:
        """The `triangles` (T, 3) with the quads that they were split from: (a, b, c), (a, c, d) in a row.

        Each triangle belongs to one quad at most; pairs are taken in order.
        """
        ids = np.asarray(triangles, dtype=np.int32)
        pairs = (ids[:-1, 0] == ids[1:, 0]) & (ids[:-1, 2] == ids[1:, 1])
        first = np.zeros(len(ids), dtype=bool)
        first[:-1] = pairs
        # In a run of pairs that overlap, every second one counts.
        last_other = np.maximum.accumulate(np.where(first, -1, np.arange(len(ids))))
        first &= (np.arange(len(ids)) - last_other) % 2 == 1
        second = np.concatenate([[False], first[:-1]])
        counts = np.where(first, 4, 3)[~second].astype(np.int32)
        keep = np.ones((len(ids), 4), dtype=bool)
        keep[:, 3] = first
        keep[second] = False
        wide = np.concatenate([ids, np.roll(ids[:, 2:], -1, axis=0)], axis=1)
        return cls(counts, wide[keep])

    @property
    def triangles(self) -> np.ndarray:
        """Triangles (T, 3) int32 as fans of the polygons, in their order."""
        wide = np.maximum(self.counts - 2, 0)
        start = np.repeat(np.cumsum(self.counts) - self.counts, wide)
        step = np.arange(wide.sum()) - np.repeat(np.cumsum(wide) - wide, wide)
        corners = np.stack(
            [self.corners[start], self.corners[start + step + 1], self.corners[start + step + 2]],
            axis=1,
        )
        return corners.astype(np.int32)

    def __len__(self) -> int:
        return len(self.counts)
