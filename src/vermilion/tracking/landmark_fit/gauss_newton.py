"""Gauss-Newton over the unknowns of each frame and the unknowns that all frames share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vermilion.tracking.landmark_fit.expression import N_POSE


class GaussNewtonProblem(Protocol):
    """An energy with its Gauss-Newton step.

    Unknowns of the frames are (F, 6 + K): rotation vector, translation, blend weights.
    """

    def cost(self, frames: np.ndarray, shared: np.ndarray) -> float:
        """The energy at `frames` (F, 6 + K) and `shared` (S,); infinite where it is undefined."""

    def newton_step(self, frames: np.ndarray, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step of `frames` (F, 6 + K) and step of `shared` (S,)."""


def gauss_newton(
    problem: GaussNewtonProblem, frames: np.ndarray, shared: np.ndarray, iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    """The unknowns after at most `iterations` steps, each shortened until the energy falls.

    Args:
        problem: the energy.
        frames: (F, 6 + K) first guess; weights are clipped to [0, 1] in every step.
        shared: (S,) first guess.
        iterations: steps, at most.

    Returns:
        frames (F, 6 + K) and shared (S,) of the lowest energy found.
    """
    cost = problem.cost(frames, shared)
    for _ in range(iterations):
        frame_step, shared_step = problem.newton_step(frames, shared)
        for scale in (1.0, 0.5, 0.25, 0.1, 0.03):
            trial = frames + scale * frame_step, shared + scale * shared_step
            trial[0][:, N_POSE:] = np.clip(trial[0][:, N_POSE:], 0.0, 1.0)
            trial_cost = problem.cost(*trial)
            if trial_cost < cost:
                break
        else:
            break
        improvement, cost = cost - trial_cost, trial_cost
        frames, shared = trial
        if improvement < 1e-6 * cost:
            break
    return frames, shared


@dataclass(frozen=True)
class NormalEquations:
    """The Gauss-Newton system at one state.

    Attributes:
        blocks: (F, P, P) of each frame's unknowns.
        coupling: (F, P, S) between each frame's unknowns and the shared ones.
        system: (S, S) of the shared unknowns.
        frame_gradient: (F, P).
        shared_gradient: (S,).
    """

    blocks: np.ndarray
    coupling: np.ndarray
    system: np.ndarray
    frame_gradient: np.ndarray
    shared_gradient: np.ndarray


def active_bounds(frames: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """(F, 6 + K) bool: blend weights at a bound that a step downhill would cross.

    `frames` (F, 6 + K) are the unknowns, `gradient` (F, 6 + K) is the energy's.
    """
    held = np.zeros(frames.shape, dtype=bool)
    weights, pull = frames[:, N_POSE:], gradient[:, N_POSE:]
    held[:, N_POSE:] = ((weights <= 0) & (pull > 0)) | ((weights >= 1) & (pull < 0))
    return held
