"""Loop subdivision as a matrix: every frame of a take gets the same finer topology."""

from __future__ import annotations

import numpy as np
from scipy import sparse


def loop_subdivision(
    triangles: np.ndarray, n_vertices: int, levels: int
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Matrix (V', V) from coarse to fine vertices, and the fine triangles (4^levels T, 3) int32.

    Loop 1987 with Warren's weights. Border vertices follow the border's cubic spline; vertices without
    a triangle do not move. The first V fine vertices are the coarse ones, moved.

    Args:
        triangles: (T, 3).
        n_vertices: V.
        levels: subdivisions.
    """
    total = sparse.identity(n_vertices, format="csr")
    for _ in range(levels):
        step, triangles = _once(triangles, total.shape[0])
        total = step @ total
    return total.tocsr(), triangles


def _once(triangles: np.ndarray, n: int) -> tuple[sparse.csr_matrix, np.ndarray]:
    corners = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    opposite = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    edges, of, count = np.unique(
        np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    of, inner = of.reshape(-1), count > 1
    # New vertices: 3/8 of the ends and 1/8 of what lies opposite; the middle, on the border.
    m = len(edges)
    ends = np.where(inner, 0.375, 0.5)
    rows = np.concatenate([np.arange(m), np.arange(m), of[inner[of]]])
    columns = np.concatenate([edges[:, 0], edges[:, 1], opposite[inner[of]]])
    values = np.concatenate([ends, ends, (0.25 / count[of])[inner[of]]])
    new = sparse.csr_matrix((values, (rows, columns)), shape=(m, n))

    both = np.concatenate([edges, edges[:, ::-1]])
    border = np.zeros(n, dtype=bool)
    border[edges[~inner]] = True
    inside = ~border[both[:, 0]]
    along = np.concatenate([~inner, ~inner])
    ring = np.bincount(both[:, 0], minlength=n)
    beta = np.where(ring > 3, 3 / (8 * np.maximum(ring, 1)), 3 / 16)
    weight = np.where(inside, beta[both[:, 0]], 0.0)
    # A border vertex takes an eighth of each of its two neighbours along the border.
    share = 0.25 / np.maximum(np.bincount(both[along, 0], minlength=n), 1)
    weight = np.where(along & ~inside, share[both[:, 0]], weight)
    old = sparse.csr_matrix((weight, (both[:, 0], both[:, 1])), shape=(n, n))
    old = old + sparse.diags(1 - np.asarray(old.sum(axis=1)).ravel())

    ab, bc, ca = (of[k * len(triangles) : (k + 1) * len(triangles)] + n for k in range(3))
    a, b, c = triangles.T
    fine = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    finer = np.stack([np.stack(t, axis=1) for t in fine], axis=1).reshape(-1, 3)
    return sparse.vstack([old, new]).tocsr(), finer.astype(np.int32)
