"""Loop subdivision as a matrix: every frame of a take gets the same finer topology."""

from __future__ import annotations

import numpy as np
from scipy import sparse


def loop_subdivision(
    points_mm: np.ndarray,
    triangles: np.ndarray,
    levels: int,
    longest_mm: float,
    wanted: np.ndarray,
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Matrix (V', V) from coarse to fine vertices, and the fine triangles (T', 3) int32.

    Loop 1987 with Warren's weights. Border vertices follow the border's cubic spline; vertices without
    a triangle do not move. The first V fine vertices are the coarse ones, moved. A triangle with an edge of more than a length becomes four, level by level; its neighbours become two or
    three. A vertex moves as Loop has it where all of its edges are halved, and stays elsewhere.

    Args:
        points_mm: (V, 3) of which lengths are taken.
        triangles: (T, 3).
        levels: most subdivisions.
        longest_mm: no edge should be longer; 0: all triangles are divided.
        wanted: (V,) bool; edges beside other vertices may be.
    """
    total = sparse.identity(len(points_mm), format="csr")
    inside = wanted.astype(float)
    for _ in range(levels):
        points, keep = total @ points_mm, total @ inside > 0.5
        a, b = triangles[:, [0, 1, 2]].ravel(), triangles[:, [1, 2, 0]].ravel()
        long = np.linalg.norm(points[a] - points[b], axis=1) > longest_mm
        divided = (long & keep[a] & keep[b]).reshape(-1, 3).any(axis=1)
        if not divided.any():
            break
        halved = np.repeat(divided[:, None], 3, axis=1)
        step, triangles = _once(triangles, total.shape[0], halved)
        total = step @ total
    return total.tocsr(), triangles.astype(np.int32)


def _once(
    triangles: np.ndarray, n: int, halved: np.ndarray
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """One level; `halved` (T, 3) bool for edges 01, 12, 20 of triangles, each of one."""
    corners = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    opposite = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    edges, of, count = np.unique(
        np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    of, inner = of.reshape(-1), count > 1
    split = np.zeros(len(edges), dtype=bool)
    split[of[halved.T.ravel()]] = True
    # New vertices: 3/8 of the ends and 1/8 of what lies opposite; the middle, on the border.
    m = len(edges)
    ends = np.where(inner, 0.375, 0.5)
    rows = np.concatenate([np.arange(m), np.arange(m), of[inner[of]]])
    columns = np.concatenate([edges[:, 0], edges[:, 1], opposite[inner[of]]])
    values = np.concatenate([ends, ends, (0.25 / count[of])[inner[of]]])
    new = sparse.csr_matrix((values, (rows, columns)), shape=(m, n))[split]
    old = _moved(edges, inner, split, n)
    number = np.cumsum(split) - 1 + n
    middles = np.where(split, number, -1)[of].reshape(3, -1).T
    return sparse.vstack([old, new]).tocsr(), _divided(triangles, middles).astype(np.int32)


def _moved(edges: np.ndarray, inner: np.ndarray, split: np.ndarray, n: int) -> sparse.csr_matrix:
    """Matrix (n, n) that moves the old vertices whose edges (m, 2) are all split."""
    both = np.concatenate([edges, edges[:, ::-1]])
    border = np.zeros(n, dtype=bool)
    border[edges[~inner]] = True
    still = np.zeros(n, dtype=bool)
    still[edges[~split]] = True
    inside = ~border[both[:, 0]]
    along = np.concatenate([~inner, ~inner])
    ring = np.bincount(both[:, 0], minlength=n)
    beta = np.where(ring > 3, 3 / (8 * np.maximum(ring, 1)), 3 / 16)
    weight = np.where(inside, beta[both[:, 0]], 0.0)
    # A border vertex takes an eighth of each of its two neighbours along the border.
    share = 0.25 / np.maximum(np.bincount(both[along, 0], minlength=n), 1)
    weight = np.where(along & ~inside, share[both[:, 0]], weight)
    weight[still[both[:, 0]]] = 0.0
    old = sparse.csr_matrix((weight, (both[:, 0], both[:, 1])), shape=(n, n))
    return old + sparse.diags(1 - np.asarray(old.sum(axis=1)).ravel())


def _divided(triangles: np.ndarray, middles: np.ndarray) -> np.ndarray:
    """Triangles after their edges got middles (T, 3), of edges 01, 12, 20; -1 for a whole edge."""
    has = middles >= 0
    count = has.sum(axis=1)
    parts = [triangles[count == 0]]
    a, b, c = triangles[count == 3].T
    ab, bc, ca = middles[count == 3].T
    fine = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    parts.append(np.stack([np.stack(t, axis=1) for t in fine], axis=1).reshape(-1, 3))
    for some in (1, 2):
        # Turned so that the only halved edge is 01, or the only whole edge is 20.
        rows = np.flatnonzero(count == some)
        first = has[rows].argmax(axis=1) if some == 1 else ((~has[rows]).argmax(axis=1) + 1) % 3
        turn = (first[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(triangles[rows], turn, axis=1).T
        ab, bc, _ = np.take_along_axis(middles[rows], turn, axis=1).T
        pieces = [(a, ab, c), (ab, b, c)] if some == 1 else [(a, ab, c), (ab, bc, c), (ab, b, bc)]
        parts.append(np.stack([np.stack(t, axis=1) for t in pieces], axis=1).reshape(-1, 3))
    return np.concatenate(parts)
