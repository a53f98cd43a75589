"""A tree of boxes round triangles, and the search in it for the triangle that is closest to a point.

The triangles are sorted along a Morton curve and cut into leaves of a few; the tree over the leaves is
complete, so that the boxes of a level are pairs of those of the level below.
"""

from __future__ import annotations

import math

import numpy as np

_LEAF = 4  # triangles, at most
_BITS = 10  # of each axis in a place on the curve


class TriangleTree:
    """Triangles prepared for exact closest-point queries.

    Args:
        corners: (T, 3, 3) float64, C order, T > 0; triangle, corner, coordinate.
    """

    def __init__(self, corners: np.ndarray):
        self._order = np.argsort(_curve(corners.mean(axis=1)), kind="stable")
        self._corners = corners[self._order]
        n_leaves = 1 << max(0, math.ceil(math.log2(len(corners) / _LEAF)))
        self._starts = np.arange(n_leaves + 1) * len(corners) // n_leaves
        low, high = self._corners.min(axis=1), self._corners.max(axis=1)
        levels = [
            (
                np.minimum.reduceat(low, self._starts[:-1]),
                np.maximum.reduceat(high, self._starts[:-1]),
            )
        ]
        while len(levels[-1][0]) > 1:
            low, high = levels[-1]
            levels.append((np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])))
        # As in a heap: the children of node k are 2 k + 1 and 2 k + 2.
        self._boxes = np.concatenate([np.hstack(level) for level in levels[::-1]])

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The closest triangle to each of the points (N, 3) float64, finite.

        Returns:
            triangle (N,), barycentric weights (N, 3) of the closest point, distance (N,).
        """
        from vermilion.geometry.closest_kernels import search

        found, barycentric, distance = search(points, self._boxes, self._starts, self._corners)
        return self._order[found], barycentric, distance


def _curve(points: np.ndarray) -> np.ndarray:
    """Place (N,) of each of the points (N, 3) on a Morton curve through their box."""
    low, high = points.min(axis=0), points.max(axis=0)
    cells = (1 << _BITS) - 1
    grid = ((points - low) / max(float((high - low).max()), 1e-300) * cells).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
