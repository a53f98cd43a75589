"""The paper's regressors with scikit-learn's interface: RBF network and affine (Lips16 5.2, 6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from vermilion.regression.linear import LinearOutputs


class RBFNetwork(LinearOutputs):
    """Radial basis function network with fixed prototypes (Lips16 eqs. 2 to 4).

    Args (others: `LinearOutputs`):
        beta: scale of the Gaussians, per squared distance of scaled features (`scaling`).
        prototype_stride: every how many frames of a sequence become a prototype.
        prototype_minimum: at least so many prototypes where there are as many frames.

    Attributes (fitted): `prototypes_` (P, M) scaled, and those of `LinearOutputs`.
    """

    FITTED = ("prototypes_", *LinearOutputs.FITTED)

    def __init__(
        self,
        alpha: float = 0.1,
        beta: float = 0.1,
        prototype_stride: int = 10,
        prototype_minimum: int = 20,
        feature_groups: Sequence[str] | None = None,
        reach: float = np.inf,
        fade: float = 2.0,
        equalise: float = 0.0,
        basis_error: float = 0.0,
    ):
        super().__init__(alpha, feature_groups, reach, fade, equalise, basis_error)
        self.beta = beta
        self.prototype_stride = prototype_stride
        self.prototype_minimum = prototype_minimum

    def _choose(self, scaled: np.ndarray, sequences: np.ndarray | None) -> None:
        labels = np.zeros(len(scaled)) if sequences is None else sequences
        rows = temporal_prototypes(labels, self.prototype_stride, self.prototype_minimum)
        self.prototypes_ = scaled[rows]

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        return gaussian_activations(scaled, self.prototypes_, self.beta)

    def novelty(self, features: np.ndarray) -> np.ndarray:
        """Distance (F,) of `features` (F, M) to the nearest prototype; frames are 1.4 apart (RMS)."""
        return cdist(self.scaled(features), self.prototypes_).min(axis=1)


class AffineRegressor(LinearOutputs):
    """Affine map with Tikhonov regularisation, the paper's simple alternative (section 6)."""


def gaussian_activations(scaled: np.ndarray, prototypes: np.ndarray, beta: float) -> np.ndarray:
    """exp(-beta |p - f|^2), (F, N), of `scaled` features (F, M) and `prototypes` (N, M) (Lips16 eq. 2)."""
    return np.exp(-beta * cdist(scaled, prototypes, "sqeuclidean"))


def temporal_prototypes(sequences: np.ndarray, stride: int, minimum: int = 0) -> np.ndarray:
    """Rows of a temporally uniform sampling of each sequence, ascending.

    Args:
        sequences: (F,) labels; the frames of a sequence are in order of time.
        stride: every how many frames; shorter where fewer than `minimum` rows would come out.
    """
    sequences = np.asarray(sequences)
    stride = max(1, min(stride, len(sequences) // max(minimum, 1)))
    _, label = np.unique(sequences, return_inverse=True)
    first = stride // 2 % stride
    rows = [np.flatnonzero(label == k) for k in range(label.max() + 1)]
    # A sequence shorter than half a stride still gives its middle frame.
    chosen = [r[first::stride] if len(r) > first else r[[len(r) // 2]] for r in rows]
    return np.sort(np.concatenate(chosen))
