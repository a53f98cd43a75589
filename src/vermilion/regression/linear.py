"""What all regressors share: scaled features, a design matrix, ridge weights, a basis of layers."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from scipy import linalg

from vermilion.regression.ridge import person_averages, ridge_weights
from vermilion.regression.scaling import feature_range, feature_scale, prediction_trust

if TYPE_CHECKING:
    from sklearn.utils import Tags


class LinearOutputs:
    """Linear outputs of a design matrix, which a subclass makes of the features.

    The interface is scikit-learn's (`clone`, pipelines and searches take it), without its base class: its
    import takes a second, which every job that reads a regressor would spend.

    Args:
        alpha: ridge parameter of the weights; the bias is not penalised.
        feature_groups: labels of the features that share a scale, or None.
        reach: how far beyond the training's range a feature counts (`scaling.feature_range`).
        fade: how far further half of the prediction is left (`scaling.trust`).
        equalise: how far the features of a group share one variance (`scaling.feature_scale`).
        basis_error: how much the basis may change a prediction (`layer_basis`); 0 for nothing.

    Attributes (fitted): `coefficients_` (P, R) and `basis_` (R, K), whose product are the weights,
    `person_biases_` (G, K), `bias_` (K,) of anybody else, `mean_activation_` (P,), `deviation_` (P, P)
    from the centred design to what is uncertain of a prediction, `feature_mean_`, `feature_scale_`,
    `feature_low_`, `feature_high_` (M,).
    """

    #: Fitted arrays, by the names that they have in a model file with an underscore.
    FITTED: tuple[str, ...] = (
        "coefficients_",
        "basis_",
        "bias_",
        "person_biases_",
        "feature_mean_",
        "feature_scale_",
        "feature_low_",
        "feature_high_",
        "mean_activation_",
        "deviation_",
    )

    def __init__(
        self,
        alpha: float = 1.0,
        feature_groups: Sequence[str] | None = None,
        reach: float = np.inf,
        fade: float = 2.0,
        equalise: float = 0.0,
        basis_error: float = 0.0,
    ):
        self.alpha = alpha
        self.feature_groups = feature_groups
        self.reach = reach
        self.fade = fade
        self.equalise = equalise
        self.basis_error = basis_error

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters of the constructor by name."""
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters of the constructor; raises ValueError for any other name."""
        known = self.get_params()
        for name, value in parameters.items():
            if name not in known:
                raise ValueError(
                    f"{type(self).__name__} has no {name!r}; it has {', '.join(known)}"
                )
            setattr(self, name, value)
        return self

    def unfitted(self) -> Self:
        """Another one with the same parameters."""
        return type(self)(**self.get_params())

    def score(self, features: np.ndarray, targets: np.ndarray) -> float:
        """Coefficient of determination of the predictions for features (F, M), targets (F, K)."""
        from sklearn.metrics import r2_score

        return float(r2_score(targets, self.predict(features)))

    def __sklearn_tags__(self) -> Tags:
        from sklearn.utils import RegressorTags, Tags, TargetTags

        targets = TargetTags(required=True, multi_output=True)
        return Tags(estimator_type="regressor", target_tags=targets, regressor_tags=RegressorTags())

    def _choose(self, scaled: np.ndarray, sequences: np.ndarray | None) -> None:
        """Fit what the design needs to know of the scaled features (F, M)."""

    def _design(self, scaled: np.ndarray) -> np.ndarray:
        """Design matrix (F, P) of scaled features (F, M)."""
        return scaled

    def novelty(self, features: np.ndarray) -> np.ndarray:
        """How far features (F, M) lie from those of the training, (F,).

        The standard deviation of a prediction, in units of the weights' prior deviation times the
        design: weights of variance 1, noise of variance alpha.
        """
        design = self._design(self.scaled(features))
        return np.linalg.norm((design - self.mean_activation_) @ self.deviation_, axis=1)

    def fit(
        self,
        features: np.ndarray,
        targets: np.ndarray,
        sequences: np.ndarray | None = None,
        persons: np.ndarray | None = None,
        n_layers: int | None = None,
    ) -> Self:
        """Fit on features (F, M) and targets (F, K).

        Args:
            sequences: (F,) labels of the sequences, frames in order of time; one if None.
            persons: (F,) in 0 .. G - 1, each person starting at their neutral: a bias for each. None:
                the paper's single bias.
            n_layers: the first so many targets are layers, the others displacements: what people have
                in common is judged of each kind by itself. None: all are of one kind.
        """
        if targets.ndim != 2 or len(features) != len(targets):
            raise ValueError(
                "features and targets must be (F, M) and (F, K), "
                f"got {np.shape(features)} and {targets.shape}"
            )
        design = self.fit_inputs(features, sequences)
        labels = np.zeros(len(design), dtype=np.int64) if persons is None else persons
        weights, biases = ridge_weights(design, targets, self.alpha, persons=labels)
        self.coefficients_, self.basis_ = layer_basis(design, weights, self.alpha, self.basis_error)
        # The mean of each person's frames is kept by the bias, whatever the basis leaves out.
        means = person_averages(labels) @ design
        biases = biases + means @ weights - (means @ self.coefficients_) @ self.basis_
        self.person_biases_ = biases.astype(weights.dtype)
        self.bias_ = self.person_biases_[0]
        if persons is not None:
            first = np.unique(persons, return_index=True)[1]
            neutral = (design[first].mean(axis=0) @ self.coefficients_) @ self.basis_
            kinds = np.split(np.arange(targets.shape[1]), [n_layers or targets.shape[1]])
            self.bias_ = np.concatenate(
                [unseen_subject_bias(biases[:, k], neutral[k]) for k in kinds if len(k)]
            ).astype(weights.dtype)
        return self

    def fit_inputs(self, features: np.ndarray, sequences: np.ndarray | None = None) -> np.ndarray:
        """Design (F, P) of `features` (F, M) in `sequences` (F,): fits all but the weights."""
        features = np.asarray(features, dtype=np.float64)
        if features.ndim != 2:
            raise ValueError(f"features must be (F, M), got {features.shape}")
        self.n_features_in_ = features.shape[1]
        self.feature_mean_, self.feature_scale_ = feature_scale(
            features, self.feature_groups, self.equalise
        )
        scaled = self.scaled(features)
        self.feature_low_, self.feature_high_ = feature_range(scaled, self.reach)
        self._choose(scaled, sequences)
        design = self._design(scaled)
        self.mean_activation_ = design.mean(axis=0)
        self.deviation_ = uncertain_directions(design - self.mean_activation_, self.alpha)
        return design

    def scaled(self, features: np.ndarray) -> np.ndarray:
        """`features` (F, M) in the estimator's own scale, (F, M) float64."""
        if not hasattr(self, "feature_scale_"):
            raise AttributeError(f"this {type(self).__name__} is not fitted: call `fit` first")
        features = np.asarray(features, dtype=np.float64)
        if features.ndim != 2 or features.shape[1] != self.n_features_in_:
            raise ValueError(f"features must be (F, {self.n_features_in_}), got {features.shape}")
        return (features - self.feature_mean_) / self.feature_scale_

    def activations(self, features: np.ndarray) -> np.ndarray:
        """Design matrix (F, P) of features (F, M), drawn to its mean beyond the reach."""
        scaled = self.scaled(features)
        held = np.clip(scaled, self.feature_low_, self.feature_high_)
        added = self._design(held) - self.mean_activation_
        return self.mean_activation_ + prediction_trust(scaled, held, self.fade) * added

    def mixture(self, features: np.ndarray) -> np.ndarray:
        """Coefficients (F, R) of the basis for `features` (F, M), in its precision."""
        return (self.activations(features) @ self.coefficients_).astype(self.basis_.dtype)

    def mean_mixture(self) -> np.ndarray:
        """Coefficients (R,) of the basis for the training's mean, to which predictions fade."""
        return (self.mean_activation_ @ self.coefficients_).astype(self.basis_.dtype)

    def predict(self, features: np.ndarray, person: int | None = None) -> np.ndarray:
        """Outputs (F, K) for `features` (F, M), in the precision of the weights; `person` as in `fit`."""
        return self.mixture(features) @ self.basis_ + self.bias_of(person)

    def bias_of(self, person: int | None) -> np.ndarray:
        """(K,) of a person of the training, or of anybody else (None)."""
        return self.bias_ if person is None else self.person_biases_[person]


def layer_basis(
    design: np.ndarray, weights: np.ndarray, alpha: float, allowed: float
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (P, R) float64 and basis (R, K) with as few rows as `allowed`.

    The principal components of what is predicted: their product differs from the weights by that
    which changes predictions least. What the design may be is taken to have the second moment
    Phi' Phi + alpha of the centred training and of the ridge's prior.

    Args:
        design: (F, P).
        weights: (P, K).
        alpha: ridge parameter.
        allowed: root mean square of the change over that of the predictions about their mean.
    """
    n_rows = weights.shape[0]
    if allowed <= 0:
        return np.eye(n_rows), weights
    centred = design - design.mean(axis=0)
    values, vectors = linalg.eigh(centred.T @ centred)
    size = np.sqrt(np.maximum(values, 0.0) + alpha)
    gram = np.zeros((n_rows, n_rows))
    for first in range(0, weights.shape[1], 16384):
        part = weights[:, first : first + 16384]
        gram += part @ part.T
    # In the scaled eigenbasis the change of the weights is the change of what is predicted.
    rotated = (vectors * size).T
    energy, components = linalg.eigh(rotated @ gram @ rotated.T)
    energy, components = np.maximum(energy[::-1], 0.0), components[:, ::-1]
    left_out = energy.sum() - np.cumsum(energy)
    rank = min(int((left_out > allowed**2 * energy.sum()).sum()) + 1, n_rows)
    chosen = components[:, :rank]
    basis = (chosen.T @ rotated).astype(weights.dtype) @ weights
    return (vectors / size) @ chosen, basis


def uncertain_directions(centred: np.ndarray, alpha: float) -> np.ndarray:
    """Root D (P, P) of the weights' posterior covariance D D' = alpha (Phi' Phi + alpha)^-1.

    Args:
        centred: (F, P) design less its mean.
        alpha: ridge parameter, the variance of the noise where that of the weights is 1.
    """
    gram = centred.T @ centred
    gram[np.diag_indices_from(gram)] += alpha
    inverse = linalg.solve_triangular(linalg.cholesky(gram), np.eye(len(gram)))
    return np.sqrt(alpha) * inverse


def unseen_subject_bias(biases: np.ndarray, neutral: np.ndarray) -> np.ndarray:
    """Bias (K,) for a subject whom the training has not seen.

    The layer at the neutral holds the identity. That of an unseen subject is the mean of those seen,
    shrunk towards zero by the reliability of that mean: c = 1 - var / (G mean^2) of the G people. One
    person alone does not tell their own share from everybody's, so then the identity is zero.

    Args:
        biases: (G, K) of the people seen.
        neutral: (K,) weighted activations at the neutral, so that bias + neutral is its layer.
    """
    identity = biases + neutral
    mean, n_persons = identity.mean(axis=0), len(biases)
    worth = 0.0
    if n_persons > 1:
        spread = identity.var(axis=0, ddof=1).mean() / n_persons
        worth = float(np.clip(1.0 - spread / max(float((mean**2).mean()), 1e-300), 0.0, 1.0))
    return worth * mean - neutral
