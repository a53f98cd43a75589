"""Gauss-Newton over unknowns of frames and unknowns that all frames share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vermilion.tracking.landmark_fit.expression import N_POSE


class GaussNewtonProblem(Protocol):
    """An energy of `frames` (F, 6 + K) and `shared` (S,) unknowns, with its Gauss-Newton step."""

    def cost(self, frames: np.ndarray, shared: np.ndarray) -> float:
        """The energy; infinite where it has no meaning."""

    def newton_step(self, frames: np.ndarray, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps of both."""


def gauss_newton(
    problem: GaussNewtonProblem, frames: np.ndarray, shared: np.ndarray, iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    """The unknowns after at most `iterations` steps, each shortened until the energy falls."""
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
    """Gauss-Newton's system at one state.

    Attributes:
        blocks: (F, P, P) of each frame's unknowns.
        coupling: (F, P, S) between them and the shared ones.
        system: (S, S) of the shared ones.
        frame_gradient: (F, P).
        shared_gradient: (S,).
    """

    blocks: np.ndarray
    coupling: np.ndarray
    system: np.ndarray
    frame_gradient: np.ndarray
    shared_gradient: np.ndarray


def active_bounds(frames: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """(F, 6 + K) bool: weights at a bound that the energy's gradient would push past it."""
    held = np.zeros(frames.shape, dtype=bool)
    weights, pull = frames[:, N_POSE:], gradient[:, N_POSE:]
    held[:, N_POSE:] = ((weights <= 0) & (pull > 0)) | ((weights >= 1) & (pull < 0))
    return held
