"""Ridge regression with an unpenalised bias, for many outputs that share one design matrix.

    minimise over W, b   |Phi W + 1 b' - Y|^2 + alpha |W|^2                        (Lips16 eq. 4)

The bias is eliminated by centring; one factorisation serves all outputs.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy import linalg


def ridge_weights(
    design: np.ndarray,
    targets: np.ndarray,
    alpha: float,
    form: Literal["auto", "primal", "dual"] = "auto",
) -> tuple[np.ndarray, np.ndarray]:
    """Weights (P, K) and bias (K,) of the minimiser.

    Args:
        design: (F, P) activations.
        targets: (F, K).
        alpha: ridge parameter, > 0.
        form: solve the (P, P) or the (F, F) system; equal up to rounding, `auto` takes the smaller.
    """
    if not alpha > 0:
        raise ValueError(f"alpha must be positive, got {alpha}")
    design = np.asarray(design, dtype=np.float64)
    mean_design = design.mean(axis=0)
    mean_targets = targets.mean(axis=0, dtype=np.float64)
    centred = design - mean_design
    primal = form == "primal" or (form == "auto" and design.shape[1] <= design.shape[0])
    # The rows of `solver` map targets to weights. They sum to zero (the design is centred), so the
    # targets need no centring, which would copy the one large array.
    if primal:
        gram = centred.T @ centred
        gram[np.diag_indices_from(gram)] += alpha
        solver = linalg.solve(gram, centred.T, assume_a="pos")
    else:
        gram = centred @ centred.T
        gram[np.diag_indices_from(gram)] += alpha
        solver = linalg.solve(gram, centred, assume_a="pos").T
    weights = solver.astype(targets.dtype) @ targets
    return weights, mean_targets - mean_design @ weights
