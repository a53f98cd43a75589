"""Kernel ridge regression on all frames, with a predictive variance."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import linalg
from scipy.spatial.distance import cdist

from vermilion.regression.linear import LinearOutputs

#: Rows whose columns are made together, and how small a rest they may go down to, of the largest.
_PANEL, _FAIR = 48, 0.3
_MAX_PIVOTS = 400


class KernelRegressor(LinearOutputs):
    """Ridge regression in the space of the kernel k(f, g) = (1 + 2 beta |f - g|^2)^-1/2 + linear <f, g>.

    Where `RBFNetwork` has Gaussians at every tenth frame and penalises their weights, this has a bump
    at every frame and penalises the norm of the function that they add up to, which has the same
    meaning however close the frames lie. The bump is a rational quadratic: Gaussians of all widths
    (Rasmussen and Williams 2006, 4.2), so that fine detail and long range do not exclude each other.
    The linear part carries on where they end. In terms of Gaussian processes: the posterior mean of a
    smooth function plus an affine one, under noise of variance alpha.

    The kernel matrix of the F frames is never formed: its pivoted Cholesky factor (Fine and Scheinberg
    2001) takes the frames that are least explained by those before, until no frame's rest is above
    `tolerance` or there are 400; then the columns of the factor are the design.

    Args (others: `LinearOutputs`):
        beta: scale of the bumps, per squared distance of scaled features (`scaling`).
        linear: variance of the linear part beside that of the smooth one.
        tolerance: rest of the kernel's diagonal that is let go, of its mean.

    Attributes (fitted): `pivots_` (P, M) scaled, `whitening_` (P, P) from kernel values at the pivots
    to the design, and those of `LinearOutputs`.
    """

    FITTED = ("pivots_", "whitening_", *LinearOutputs.FITTED)

    def __init__(
        self,
        alpha: float = 0.1,
        beta: float = 1.0,
        linear: float = 1.0,
        tolerance: float = 1e-5,
        feature_groups: Sequence[str] | None = None,
        reach: float = np.inf,
        fade: float = 2.0,
        equalise: float = 0.5,
        basis_error: float = 0.0,
    ):
        super().__init__(alpha, feature_groups, reach, fade, equalise, basis_error)
        self.beta = beta
        self.linear = linear
        self.tolerance = tolerance

    def _choose(self, scaled: np.ndarray, sequences: np.ndarray | None) -> None:
        rows, factor = pivoted_cholesky(
            lambda rows: self.kernel(scaled, scaled[rows]),
            self._diagonal(scaled),
            self.tolerance,
            _MAX_PIVOTS,
        )
        self.pivots_ = scaled[rows]
        triangle = np.tril(factor[rows])
        self.whitening_ = linalg.solve_triangular(triangle, np.eye(len(rows)), lower=True).T

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        return self.kernel(scaled, self.pivots_) @ self.whitening_

    def kernel(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """k (F, G) between scaled features `first` (F, M) and `second` (G, M)."""
        smooth = 1.0 / np.sqrt(1.0 + 2.0 * self.beta * cdist(first, second, "sqeuclidean"))
        return smooth + self.linear * (first @ second.T)

    def _diagonal(self, scaled: np.ndarray) -> np.ndarray:
        return 1.0 + self.linear * (scaled**2).sum(axis=1)

    def novelty(self, features: np.ndarray) -> np.ndarray:
        """Deviation (F,) of the prediction for `features` (F, M), per the smooth part's prior deviation.

        With what the pivots cannot tell; the noise of a single frame is not in it.
        """
        scaled = self.scaled(features)
        rest = self._diagonal(scaled) - (self._design(scaled) ** 2).sum(axis=1)
        return np.hypot(super().novelty(features), np.sqrt(np.maximum(rest, 0.0)))


def pivoted_cholesky(
    columns: Callable[[np.ndarray], np.ndarray],
    diagonal: np.ndarray,
    tolerance: float,
    max_rank: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (P,) and factor (F, P) with K = factor factor' up to a diagonal rest under `tolerance`.

    Pivots are taken from panels of the rows with the largest rest, as long as that is a fair share of
    the largest of all: then most of the work is products of matrices.

    Args:
        columns: rows (n,) -> those columns (F, n) of the positive semi-definite K.
        diagonal: (F,) of K.
        tolerance: as a share of the mean of the diagonal.
        max_rank: P at most.
    """
    rest = diagonal.astype(np.float64)
    limit = tolerance * rest.mean()
    factor = np.empty((len(rest), min(max_rank, len(rest))), order="F")
    rows: list[int] = []
    while len(rows) < factor.shape[1] and rest.max() > limit:
        done = len(rows)
        candidates = np.argsort(-rest, kind="stable")[:_PANEL]
        enough = max(_FAIR * rest[candidates[0]], limit)
        panel = columns(candidates) - factor[:, :done] @ factor[candidates, :done].T
        while len(rows) < factor.shape[1]:
            best = int(rest[candidates].argmax())
            pivot = int(candidates[best])
            if rest[pivot] <= enough:
                break
            made = factor[:, done : len(rows)]
            column = (panel[:, best] - made @ made[pivot]) / np.sqrt(rest[pivot])
            rest -= column**2
            rest[pivot] = 0.0  # no row is taken twice
            factor[:, len(rows)] = column
            rows.append(pivot)
    return np.array(rows), factor[:, : len(rows)]
