"""First guess: scaled orthographic pose and blend weights, alternating (Mono13 6.2, eqs. 6-8)."""

from __future__ import annotations

import numpy as np

from vermilion.tracking.landmark_fit.banded_qp import FrameMatrix, solve_in_box
from vermilion.tracking.landmark_fit.observation import Observations
from vermilion.tracking.landmark_fit.pose import scaled_orthographic_pose
from vermilion.tracking.landmark_fit.shape import LandmarkShape


def first_guess(
    shape: LandmarkShape,
    seen: Observations,
    sigma: np.ndarray,
    focal: np.ndarray,
    weight_sigma: float,
    rounds: int = 4,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose and weights of each frame, fitted independently.

    Args:
        shape: the person's landmarks.
        seen: F frames, all valid.
        sigma: (N,) deviations of the landmarks in millimetres at the head.
        focal: (F,) focal lengths, pixels.
        weight_sigma: deviation of the blend weights about zero.
        rounds: of pose, then weights.

    Returns:
        rotation (F, 3, 3) camera from head; translation (F, 3) mm; weights (F, K).
    """
    n_frames, n_weights = len(seen.image), shape.n_expressions
    trust = seen.trust / sigma**2
    trust[:, seen.landmark_set.jaw] = 0.0  # a silhouette: no fixed points
    weights = np.zeros((n_frames, n_weights))
    for _ in range(rounds):
        rotation, scale, centre = scaled_orthographic_pose(shape.points(weights), seen.image, trust)
        basis = np.einsum("fij,knj->fnik", rotation[:, :2], shape.expressions_mm)
        flat = shape.neutral_mm @ np.swapaxes(rotation[:, :2], 1, 2)
        target = (seen.image - centre[:, None]) / scale[:, None, None] - flat
        blocks = np.einsum("fn,fnik,fnil->fkl", trust, basis, basis, optimize=True)
        blocks += np.eye(n_weights) / weight_sigma**2
        right = np.einsum("fn,fnik,fni->fk", trust, basis, target, optimize=True)
        for frame in range(n_frames):
            matrix = FrameMatrix(blocks[frame])
            before = weights[frame][None]  # of the last round: most bounds stay as they are
            weights[frame] = solve_in_box(matrix, right[frame][None], 0.0, 1.0, before)[0]
    # The scale holds at the depth of the points' mean, not of the head's origin.
    share = (trust / trust.sum(axis=1, keepdims=True))[..., None]
    mean = (share * shape.points(weights)).sum(axis=1)
    depth = focal / scale - np.einsum("fj,fj->f", rotation[:, 2], mean)
    translation = np.concatenate([centre / scale[:, None], depth[:, None]], axis=1)
    return rotation, translation, weights


def fill_gaps(values: np.ndarray, known: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """Values (F, P) of all frames from `values` (M, P) of frames `known` (M,): linear, ends held.

    A piece between cuts, `piece` (F,) int of each frame, is filled from its own frames if it has any.
    """
    every = np.arange(len(piece))
    filled = np.stack([np.interp(every, known, column) for column in values.T], axis=1)
    for number in np.unique(piece[known]):
        rows, own = np.flatnonzero(piece == number), piece[known] == number
        columns = [np.interp(rows, known[own], column) for column in values[own].T]
        filled[rows] = np.stack(columns, axis=1)
    return filled
