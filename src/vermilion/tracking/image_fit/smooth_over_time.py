"""Frames that were refined one by one, joined: smooth over time as the landmark fit is."""

from __future__ import annotations

import numpy as np

from vermilion.tracking.landmark_fit.banded_qp import BandMatrix, solve_in_box
from vermilion.tracking.landmark_fit.expression import N_POSE, LandmarkFitSettings


def smooth_over_time(
    matrices: np.ndarray,
    rights: np.ndarray,
    start: np.ndarray,
    refined: np.ndarray,
    fps: float,
    settings: LandmarkFitSettings,
) -> np.ndarray:
    """Minimum (F, 6 + K) of the frames' quadratics and of squared second differences over time.

    All frames at once and symmetric in time: it does not lag, and chunks do not show.

    Args:
        matrices: (F, P, P) and rights (F, P): each frame's energy is x'Ax/2 - b'x.
        start: (F, P) feasible, as each frame was refined by itself.
        refined: (F,) bool; the others are held where they start, and nothing crosses them.
        fps: frames a second.
        settings: what accelerations are typical.
    """
    n_params = start.shape[1]
    strength = settings.smoothness(n_params - N_POSE, fps)
    matrices, rights = matrices.copy(), rights.copy()
    matrices[~refined] = np.eye(n_params)
    rights[~refined] = start[~refined]
    triples = refined[:-2] & refined[1:-1] & refined[2:]
    none = np.zeros((max(len(start) - 1, 0), n_params))
    lower, upper = np.full(n_params, -np.inf), np.full(n_params, np.inf)
    lower[N_POSE:], upper[N_POSE:] = 0.0, 1.0
    matrix = BandMatrix(matrices, triples[:, None] * strength, none)
    return solve_in_box(matrix, rights, lower, upper, start)
