"""Cheapest smooth paths through a table of costs, by dynamic programming."""

from __future__ import annotations

import numpy as np


def cheapest_path(cost: np.ndarray, smoothness: np.ndarray) -> np.ndarray:
    """Columns (n,) of the path through (n, m) costs that is cheapest in all.

    Args:
        cost: (n, m); infinite where the path must not go.
        smoothness: (n,) cost of one column's step, squared, between row k and the next.
    """
    from vermilion.contours.path_kernel import cheapest_totals  # numba takes a quarter of a second

    totals, origin = np.array(cost, dtype=float), np.zeros(cost.shape, dtype=np.int64)
    cheapest_totals(totals, np.asarray(smoothness, dtype=float), origin)
    path = np.empty(len(cost), dtype=np.int64)
    path[-1] = totals[-1].argmin()
    for row in range(len(cost) - 1, 0, -1):
        path[row - 1] = origin[row, path[row]]
    return path


def cheapest_ring(cost: np.ndarray, smoothness: np.ndarray) -> np.ndarray:
    """Columns (n,) of the cheapest closed path: the last row is beside the first.

    Solved twice: freely, then with both ends tied in the middle of the free solution, where its
    own ends have no say. `cost` (n, m), `smoothness` (n,) as in `cheapest_path`.
    """
    n = len(cost)
    free = cheapest_path(cost, smoothness)
    start = n // 2
    tied = np.roll(cost, -start, axis=0)
    tied = np.concatenate([tied, tied[:1]])
    for row in (0, n):
        tied[row] = np.inf
        tied[row, free[start]] = cost[start, free[start]]
    path = cheapest_path(tied, np.append(np.roll(smoothness, -start), 0.0))
    return np.roll(path[:n], start)


def step_cost(ring: np.ndarray, step: float, weight: float) -> np.ndarray:
    """`smoothness` (n,) of a ring (n, 2 or 3) whose columns lie `step` apart: a slope of 1 costs `weight`."""
    apart = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    return weight * (step / np.maximum(apart, step)) ** 2
