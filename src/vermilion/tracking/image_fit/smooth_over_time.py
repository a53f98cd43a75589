"""Smoothing of frames that were fitted one by one, as the landmark fit smooths a take."""

from __future__ import annotations

import numpy as np

from vermilion.tracking.landmark_fit.banded_qp import BandMatrix, solve_in_box
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.smoothness import TemporalSmoothness


def smooth_over_time(
    matrices: np.ndarray,
    rights: np.ndarray,
    start: np.ndarray,
    refined: np.ndarray,
    smoothness: TemporalSmoothness,
) -> np.ndarray:
    """Minimum (F, P) of the frames' quadratics plus squared accelerations over time; P = 6 + K.

    One solve over the whole take, symmetric in time: it does not lag and does not depend on chunks. Nothing
    is smoothed across cuts, and fast motion of lids and mouth is let through (`smoothness`).

    Args:
        matrices: (F, P, P) A of each frame's quadratic x'Ax/2 - b'x.
        rights: (F, P) b of each frame's quadratic.
        start: (F, P) the fit of each frame by itself.
        refined: (F,) bool; the other frames keep `start` and stop the smoothing.
        smoothness: of the F frames, those `refined` binding.
    """
    n_params = start.shape[1]
    matrices, rights = matrices.copy(), rights.copy()
    matrices[~refined] = np.eye(n_params)
    rights[~refined] = start[~refined]
    none = np.zeros((max(len(start) - 1, 0), n_params))
    lower, upper = np.full(n_params, -np.inf), np.full(n_params, np.inf)
    lower[N_POSE:], upper[N_POSE:] = 0.0, 1.0
    matrix = BandMatrix(matrices, smoothness.weights, none, smoothness.timeline.stencils)
    return solve_in_box(matrix, rights, lower, upper, start)
