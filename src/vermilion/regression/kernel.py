"""Kernel ridge regression on all frames, with a predictive variance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg
from scipy.spatial.distance import cdist

from vermilion.regression.linear import LinearOutputs


class KernelRegressor(LinearOutputs):
    """Ridge regression in the space of the kernel k(f, g) = exp(-beta |f - g|^2) + linear <f, g>.

    Where `RBFNetwork` has Gaussians at every tenth frame and penalises their weights, this has one at
    every frame and penalises the norm of the function that they add up to, which has the same meaning
    however close the frames lie. The linear part carries on where the Gaussians end. In terms of
    Gaussian processes: the posterior mean of a smooth function plus an affine one, under noise of
    variance alpha.

    The kernel matrix of the F frames is never formed: its pivoted Cholesky factor (Fine and Scheinberg
    2001) takes the frames that are least explained by those before, until no frame's rest is above
    `tolerance`; then the columns of the factor are the design.

    Args (others: `LinearOutputs`):
        beta: scale of the Gaussians, per squared distance of scaled features (`scaling`).
        linear: variance of the linear part beside that of the smooth one.
        tolerance: rest of the kernel's diagonal that is let go, of 1 + linear.
        max_pivots: at most so many pivots.

    Attributes (fitted): `pivots_` (P, M) scaled; `whitening_` (P, P) from kernel values at the pivots
    to the design; `deviation_` (P, P) from the centred design to what is uncertain of a prediction.
    """

    FITTED = ("pivots_", "whitening_", "deviation_", *LinearOutputs.FITTED)

    def __init__(
        self,
        alpha: float = 0.01,
        beta: float = 0.1,
        linear: float = 1.0,
        tolerance: float = 1e-5,
        max_pivots: int = 800,
        feature_groups: Sequence[str] | None = None,
        reach: float = np.inf,
        fade: float = 2.0,
        basis_error: float = 0.0,
    ):
        super().__init__(alpha, feature_groups, reach, fade, basis_error)
        self.beta = beta
        self.linear = linear
        self.tolerance = tolerance
        self.max_pivots = max_pivots

    def _choose(self, scaled: np.ndarray, sequences: np.ndarray | None) -> None:
        rows, factor = pivoted_cholesky(
            lambda index: self.kernel(scaled, scaled[[index]])[:, 0],
            self._diagonal(scaled),
            self.tolerance,
            self.max_pivots,
        )
        self.pivots_ = scaled[rows]
        triangle = np.tril(factor[rows])
        self.whitening_ = linalg.solve_triangular(triangle, np.eye(len(rows)), lower=True).T
        centred = factor - factor.mean(axis=0)
        gram = centred.T @ centred
        gram[np.diag_indices_from(gram)] += self.alpha
        root = linalg.cholesky(gram)
        self.deviation_ = np.sqrt(self.alpha) * linalg.solve_triangular(root, np.eye(len(rows)))

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        return self.kernel(scaled, self.pivots_) @ self.whitening_

    def kernel(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """k (F, G) between scaled features (F, M) and (G, M)."""
        smooth = np.exp(-self.beta * cdist(first, second, "sqeuclidean"))
        return smooth + self.linear * (first @ second.T)

    def _diagonal(self, scaled: np.ndarray) -> np.ndarray:
        return 1.0 + self.linear * (scaled**2).sum(axis=1)

    def novelty(self, features: np.ndarray) -> np.ndarray:
        """Standard deviation of a prediction, of 1 where nothing is known, (F,).

        In units of the layers' prior deviation; the noise of a single frame is not in it.
        """
        scaled = self.scaled(features)
        design = self._design(scaled)
        known = ((design - self.mean_activation_) @ self.deviation_) ** 2
        rest = np.maximum(self._diagonal(scaled) - (design**2).sum(axis=1), 0.0)
        return np.sqrt(known.sum(axis=1) + rest)


def pivoted_cholesky(
    column, diagonal: np.ndarray, tolerance: float, max_rank: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (P,) and factor (F, P) with K = factor factor' up to a diagonal rest under `tolerance`.

    Args:
        column: index -> column (F,) of the positive semi-definite K.
        diagonal: (F,) of K.
        tolerance: as a share of the mean of the diagonal.
        max_rank: P at most.
    """
    rest = diagonal.astype(np.float64).copy()
    limit = tolerance * rest.mean()
    rank = min(max_rank, len(rest))
    factor = np.zeros((len(rest), rank), order="F")
    rows = []
    for k in range(rank):
        pivot = int(rest.argmax())
        if rest[pivot] <= limit:
            break
        # The rest at a pivot is zero from then on: no row is taken twice.
        value = column(pivot) - factor[:, :k] @ factor[pivot, :k]
        factor[:, k] = value / np.sqrt(rest[pivot])
        rest -= factor[:, k] ** 2
        rest[pivot] = 0.0
        rows.append(pivot)
    return np.array(rows), factor[:, : len(rows)]
