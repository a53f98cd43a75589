"""The paper's regressors with scikit-learn's interface: RBF network and affine (Lips16 5.2, 6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from vermilion.regression.ridge import ridge_weights
from vermilion.regression.scaling import feature_range, feature_scale, trust


class _LinearOutputs(RegressorMixin, BaseEstimator):
    """A fixed map of the features to a design matrix, then linear outputs."""

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def scaled(self, features: np.ndarray) -> np.ndarray:
        """Features (F, M) in the estimator's own scale, float64."""
        check_is_fitted(self)
        features = np.asarray(features, dtype=np.float64)
        if features.ndim != 2 or features.shape[1] != self.n_features_in_:
            raise ValueError(f"features must be (F, {self.n_features_in_}), got {features.shape}")
        return (features - self.feature_mean_) / self.feature_scale_

    def activations(self, features: np.ndarray) -> np.ndarray:
        """Design matrix (F, P) of features (F, M), drawn to its mean beyond the reach."""
        scaled = self.scaled(features)
        held = np.clip(scaled, self.feature_low_, self.feature_high_)
        added = self._design(held) - self.mean_activation_
        return self.mean_activation_ + trust(scaled, held, self.fade) * added

    def predict(self, features: np.ndarray, person: int | None = None) -> np.ndarray:
        """Outputs (F, K), in the precision of the weights; `person` as labelled in `fit`."""
        design = self.activations(features).astype(self.weights_.dtype)
        return design @ self.weights_ + self.bias_of(person)

    def predict_frames_last(self, features: np.ndarray, person: int | None = None) -> np.ndarray:
        """Outputs (K, F): the order in which the integration reads them."""
        design = self.activations(features).astype(self.weights_.dtype)
        return self.weights_.T @ design.T + self.bias_of(person)[:, None]

    def bias_of(self, person: int | None) -> np.ndarray:
        """(K,) of a person of the training, or of anybody else (None)."""
        return self.bias_ if person is None else self.person_biases_[person]

    def _fit_scale(self, features: np.ndarray, targets: np.ndarray) -> np.ndarray:
        features = np.asarray(features, dtype=np.float64)
        if features.ndim != 2 or targets.ndim != 2 or len(features) != len(targets):
            raise ValueError(
                "features and targets must be (F, M) and (F, K), "
                f"got {features.shape} and {targets.shape}"
            )
        self.n_features_in_ = features.shape[1]
        self.feature_mean_, self.feature_scale_ = feature_scale(features, self.feature_groups)
        scaled = (features - self.feature_mean_) / self.feature_scale_
        self.feature_low_, self.feature_high_ = feature_range(scaled, self.reach)
        return scaled

    def _fit_outputs(
        self, design: np.ndarray, targets: np.ndarray, persons: np.ndarray | None
    ) -> None:
        self.mean_activation_ = design.mean(axis=0)
        weights, biases = ridge_weights(design, targets, self.alpha, persons=persons)
        self.weights_ = weights
        self.person_biases_ = biases.astype(weights.dtype)
        self.bias_ = self.person_biases_[0]
        if persons is not None:
            first = np.unique(persons, return_index=True)[1]
            neutral = design[first].mean(axis=0) @ weights
            self.bias_ = bias_of_a_stranger(biases, neutral).astype(weights.dtype)


class RBFNetwork(_LinearOutputs):
    """Radial basis function network with fixed prototypes (Lips16 eqs. 2 to 4).

    Args:
        alpha: ridge parameter of the weights; the bias is not penalised.
        beta: scale of the Gaussians, per squared distance of scaled features (`scaling`).
        prototype_stride: every how many frames of a sequence become a prototype.
        prototype_minimum: at least so many prototypes where there are as many frames.
        feature_groups: labels of the features that share a scale, or None.
        reach: how far beyond the training's range a feature counts (`scaling.feature_range`).
        fade: how far further half of the prediction is left (`scaling.trust`).

    Attributes (fitted): `prototypes_` (N, M) scaled, `weights_` (N, K), `person_biases_` (G, K),
    `bias_` (K,) of anybody else, `mean_activation_` (N,), `feature_mean_`, `feature_scale_`, `feature_low_`, `feature_high_` (M,).
    """

    def __init__(
        self,
        alpha: float = 0.1,
        beta: float = 0.1,
        prototype_stride: int = 10,
        prototype_minimum: int = 20,
        feature_groups: Sequence[str] | None = None,
        reach: float = np.inf,
        fade: float = 2.0,
    ):
        self.alpha = alpha
        self.beta = beta
        self.prototype_stride = prototype_stride
        self.prototype_minimum = prototype_minimum
        self.feature_groups = feature_groups
        self.reach = reach
        self.fade = fade

    def fit(
        self,
        features: np.ndarray,
        targets: np.ndarray,
        sequences: np.ndarray | None = None,
        prototypes: np.ndarray | None = None,
        persons: np.ndarray | None = None,
    ) -> RBFNetwork:
        """Fit on features (F, M) and targets (F, K).

        Args:
            sequences: (F,) labels of the sequences, frames in order of time; one if None.
            prototypes: (N,) rows to use as prototypes in place of the temporal sampling.
            persons: (F,) in 0 .. G - 1, each person starting at their neutral: a bias for each. None:
                the paper's single bias.
        """
        scaled = self._fit_scale(features, targets)
        if prototypes is None:
            prototypes = temporal_prototypes(
                np.zeros(len(scaled)) if sequences is None else sequences,
                self.prototype_stride,
                self.prototype_minimum,
            )
        self.prototypes_ = scaled[prototypes]
        self._fit_outputs(self._design(scaled), targets, persons)
        return self

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        return gaussian_activations(scaled, self.prototypes_, self.beta)


class AffineRegressor(_LinearOutputs):
    """Affine map with Tikhonov regularisation, the paper's simple alternative (section 6).

    Args:
        alpha: ridge parameter of the linear part.
        feature_groups: labels of the features that share a scale, or None.
        reach: how far beyond the training's range a feature counts (`scaling.feature_range`).
        fade: how far further half of the prediction is left (`scaling.trust`).
    """

    def __init__(
        self,
        alpha: float = 2.0,
        feature_groups: Sequence[str] | None = None,
        reach: float = np.inf,
        fade: float = 2.0,
    ):
        self.alpha = alpha
        self.feature_groups = feature_groups
        self.reach = reach
        self.fade = fade

    def fit(
        self,
        features: np.ndarray,
        targets: np.ndarray,
        sequences: np.ndarray | None = None,
        persons: np.ndarray | None = None,
    ) -> AffineRegressor:
        """Fit on features (F, M) and targets (F, K); `sequences` plays no part, `persons` as above."""
        self._fit_outputs(self._design(self._fit_scale(features, targets)), targets, persons)
        return self

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        return scaled


def bias_of_a_stranger(biases: np.ndarray, neutral: np.ndarray) -> np.ndarray:
    """Bias (K,) for a person whom the training has not seen.

    The layer at the neutral is identity. A stranger's is expected to be the mean of those seen,
    drawn towards none by what that mean is worth: c = 1 - var / (G mean^2) of the G people, and one
    half where there is but one.

    Args:
        biases: (G, K) of the people seen.
        neutral: (K,) weighted activations at the neutral, so that bias + neutral is its layer.
    """
    identity = biases + neutral
    mean, n_persons = identity.mean(axis=0), len(biases)
    worth = 0.5
    if n_persons > 1:
        spread = identity.var(axis=0, ddof=1).mean() / n_persons
        worth = float(np.clip(1.0 - spread / max(float((mean**2).mean()), 1e-300), 0.0, 1.0))
    return worth * mean - neutral


def gaussian_activations(scaled: np.ndarray, prototypes: np.ndarray, beta: float) -> np.ndarray:
    """exp(-beta |p - f|^2), (F, N), of features (F, M) and prototypes (N, M) (Lips16 eq. 2)."""
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
    rows = [
        np.flatnonzero(label == k)[stride // 2 % stride :: stride] for k in range(label.max() + 1)
    ]
    # A sequence shorter than half a stride still gives its middle frame.
    rows = [
        r if len(r) else np.flatnonzero(label == k)[[(label == k).sum() // 2]]
        for k, r in enumerate(rows)
    ]
    return np.sort(np.concatenate(rows))
