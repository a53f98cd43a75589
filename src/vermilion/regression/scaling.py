"""Scaling of features, so that one width of the basis functions fits all of them.

The paper's beta = 0.1 belongs to the scale of its features, which it does not give. Here features
are centred and scaled so that their total variance is 1: the mean squared distance of two frames
is then 2, whatever the number of features, and beta has the same meaning on every data set.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def feature_scale(
    features: np.ndarray, groups: Sequence[str] | None = None, equalise: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (M,) and divisor (M,) of features (F, M).

    Args:
        features: (F, M).
        groups: M labels; the features of a group share one divisor, so that their own proportions
            last (principal components keep their variances), and every group has the same total
            variance. None: every feature is a group.
        equalise: how far the features of a group are brought to one variance: 0 keeps their
            proportions, 1 makes them equal, 1/2 lies between in the ratio of deviations.

    A feature that never changes gets the divisor of infinity: it tells nothing, and a new value of
    it must not either.
    """
    features = np.asarray(features, dtype=np.float64)
    mean, variance = features.mean(axis=0), features.var(axis=0)
    labels = np.arange(features.shape[1]) if groups is None else np.asarray(groups)
    _, group = np.unique(labels, return_inverse=True)
    constant = variance <= 1e-24 * max(1.0, float(np.abs(mean).max(initial=0.0)) ** 2)
    own = np.where(constant, 1.0, variance) ** (equalise / 2)
    total = np.bincount(group, weights=np.where(constant, 0.0, variance / own**2))
    divisor = own * np.sqrt(total * max(int((total > 0).sum()), 1))[group]
    return mean, np.where(constant, np.inf, divisor)


def feature_range(scaled: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest value (M,) that a scaled feature (F, M) counts with.

    Beyond what the training has seen a network falls back to its bias and a linear map runs away;
    a feature that is held at the border of the training leaves the nearest layer that is known.

    Args:
        reach: how far beyond, as a share of the range seen; infinite for no limit.
    """
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    if np.isinf(reach):
        return np.full_like(low, -np.inf), np.full_like(high, np.inf)
    return low - reach * (high - low), high + reach * (high - low)


def prediction_trust(scaled: np.ndarray, held: np.ndarray, fade: float) -> np.ndarray:
    """How much a prediction counts whose features `scaled` were `held` within reach, both (F, M): (F, 1).

    1 / (1 + (d / fade)^2) of the distance d by which they were held, in units where the training
    lies 1 from its mean in the root mean square.
    """
    return 1.0 / (1.0 + ((scaled - held) ** 2).sum(axis=1, keepdims=True) / fade**2)
