"""High-pass filter of values on triangles."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.geometry.sparse import CholeskyFactor


def graph_laplacian(
    pairs: np.ndarray, centres_mm: np.ndarray, length_mm: float
) -> sparse.csr_matrix:
    """Laplacian (Q, Q) of neighbouring triangles; smoothing with it has the range `length_mm`.

    Args:
        pairs: (P, 2) triangles that share an edge.
        centres_mm: (Q, 3).
        length_mm: range of the smoothing.
    """
    n = len(centres_mm)
    apart = np.linalg.norm(centres_mm[pairs[:, 0]] - centres_mm[pairs[:, 1]], axis=1)
    weight = (length_mm / np.maximum(apart, 1e-3)) ** 2
    weight = np.minimum(weight, 100 * np.median(weight)) if len(weight) else weight
    graph = sparse.csr_matrix((weight, (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    graph = graph + graph.T
    return sparse.diags(np.asarray(graph.sum(axis=1)).ravel()) - graph


class HighPassFilter:
    """Values minus their smooth part, a least-squares fit to values (by trust) and to neighbours."""

    def __init__(
        self, pairs: np.ndarray, centres_mm: np.ndarray, trust: np.ndarray, length_mm: float
    ):
        """`pairs` (P, 2) triangles that share an edge; `centres_mm` (Q, 3); `trust` (Q,) >= 0."""
        self._trust = trust / max(trust.max(), 1e-9) + 1e-3
        laplacian = graph_laplacian(pairs, centres_mm, length_mm)
        self._factor = CholeskyFactor(laplacian + sparse.diags(self._trust))

    def smooth(self, values: np.ndarray) -> np.ndarray:
        """The smooth part of `values`, (Q,) or (Q, C)."""
        trust = self._trust.reshape(-1, *[1] * (values.ndim - 1))
        return self._factor.solve(trust * values)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The high-pass part of values, (Q,) or (Q, C)."""
        return values - self.smooth(values)
