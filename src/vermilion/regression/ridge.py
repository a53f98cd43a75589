"""Ridge regression with an unpenalised bias, for many outputs that share one design matrix.

    minimise over W, b   |Phi W + 1 b' - Y|^2 + alpha |W|^2                        (Lips16 eq. 4)

The bias is eliminated by centring; one factorisation serves all outputs. Each person may have a bias
of their own: it takes the part of the layers that is identity (the factor D_0 of eq. 1), which no
feature of an expression can tell.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy import linalg, sparse


def ridge_weights(
    design: np.ndarray,
    targets: np.ndarray,
    alpha: float,
    form: Literal["auto", "primal", "dual"] = "auto",
    persons: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Weights (P, K) and biases (G, K) of the minimiser.

    Args:
        design: (F, P) activations.
        targets: (F, K).
        alpha: ridge parameter, > 0.
        form: solve the (P, P) or the (F, F) system; equal up to rounding, `auto` takes the smaller.
        persons: (F,) in 0 .. G - 1; each has a bias of its own. None: one bias for all.
    """
    if not alpha > 0:
        raise ValueError(f"alpha must be positive, got {alpha}")
    persons = np.zeros(len(design), dtype=np.int64) if persons is None else persons
    averaging = person_averages(persons)
    design = np.asarray(design, dtype=np.float64)
    mean_design = averaging @ design
    centred = design - mean_design[persons]
    primal = form == "primal" or (form == "auto" and design.shape[1] <= design.shape[0])
    # The rows of `solver` map targets to weights. They sum to zero over each person (the design is
    # centred), so the targets need no centring, which would copy the one large array.
    if primal:
        gram = centred.T @ centred
        gram[np.diag_indices_from(gram)] += alpha
        solver = linalg.solve(gram, centred.T, assume_a="pos")
    else:
        gram = centred @ centred.T
        gram[np.diag_indices_from(gram)] += alpha
        solver = linalg.solve(gram, centred, assume_a="pos").T
    weights = solver.astype(targets.dtype) @ targets
    return weights, averaging @ targets - mean_design @ weights


def person_averages(persons: np.ndarray) -> sparse.csr_array:
    """Matrix (G, F) that averages the rows of each person; `persons` (F,) in 0 .. G - 1."""
    counts = np.bincount(persons)
    data = 1.0 / counts[persons]
    return sparse.csr_array(
        (data, (persons, np.arange(len(persons)))), shape=(len(counts), len(persons))
    )
