"""What regressors are tried on."""

import numpy as np


def smooth_data() -> tuple[np.ndarray, np.ndarray]:
    """Smooth features (120, 7) and outputs (120, 30) that depend on them without being linear."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(120, 7)).cumsum(axis=0)
    targets = np.sin(0.3 * features @ rng.normal(size=(7, 30)))
    return features, targets + 0.05 * rng.normal(size=targets.shape)
