"""Constraints of neighbouring frames solved together, so that the lips do not tremble with what is found in each.

What a frame's contours ask for has noise, and so does which points are asked. The displacements of all frames
are a Gaussian process: their covariance is A^-1 between vertices, as in `constraints`, times k(f - g) between
frames. With rows J_f, targets r_f and compliances s_f of frame f, the minimum is

    x_f = x0_f + A^-1 sum_g k(f - g) J_g^T l_g,      sum_g (k(f - g) S_fg + [f = g] diag(s_f)) l_g = r_f

where S_fg is the response of the constraints of f to forces of g. A displacement that several frames agree on
comes through whole and without lag. As k has compact support (Wendland 1995), the system is banded by frames.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from vermilion.correction.constraints import (
    LEAST_COMPLIANCE,
    ConstraintSolver,
    LinearConstraints,
)

#: Solves, between which one-sided constraints that would pull back are left out.
_ROUNDS = 3


def frame_correlation(frames: np.ndarray, reach: float) -> np.ndarray:
    """k(f - g), (F, F): Wendland's function of order 2.

    Args:
        frames: (F,) frame numbers, ascending.
        reach: frames apart where it ends; 0: each frame by itself.
    """
    apart = np.abs(np.subtract.outer(frames, frames)) / max(reach, 1e-9)
    return np.maximum(1.0 - apart, 0.0) ** 4 * (1.0 + 4.0 * np.minimum(apart, 1.0))


def coherent_pushes(
    solver: ConstraintSolver, constraints: Sequence[LinearConstraints], correlation: np.ndarray
) -> list[np.ndarray]:
    """What pushes the mesh of each frame, as `ConstraintSolver.pushes`: (K + 1, 3) of each of F frames.

    Args:
        solver: of the person's mesh.
        constraints: of each of F frames; a one-sided one that would have to pull back does not count.
        correlation: (F, F) of `frame_correlation`.
    """
    left = list(constraints)
    for last in (*[False] * (_ROUNDS - 1), True):
        blocks = _system(solver, left, correlation)
        forces = _solved(blocks, [of_frame.target_mm for of_frame in left])
        back = [c.one_sided & (f < 0) for c, f in zip(left, forces, strict=True)]
        if last or not any(b.any() for b in back):
            break
        left = [c[~b] for c, b in zip(left, back, strict=True)]
    kept = [np.where(b, 0.0, f) for b, f in zip(back, forces, strict=True)]
    own = np.stack([solver.pushes(c, f) for c, f in zip(left, kept, strict=True)])
    return list(np.einsum("fg,gki->fki", correlation, own))


def _system(
    solver: ConstraintSolver, constraints: Sequence[LinearConstraints], correlation: np.ndarray
) -> list[list[np.ndarray]]:
    """Lower blocks of the system: of frame f those of f, f - 1, ... as far as it is correlated."""
    answers = [solver.answers(of_frame) for of_frame in constraints]
    blocks = []
    for f, of_frame in enumerate(constraints):
        row = [
            correlation[f, g] * solver.response_of(answers[f], of_frame, constraints[g])
            for g in range(f, -1, -1) if correlation[f, g] > 0
        ]  # fmt: skip
        row[0] = row[0] + np.diag(of_frame.compliance + LEAST_COMPLIANCE)
        blocks.append(row)
    return blocks


def _solved(blocks: list[list[np.ndarray]], right: list[np.ndarray]) -> list[np.ndarray]:
    """The system's solution by Cholesky's method on blocks; blocks[f][k] is that of f and f - k."""
    factor: list[list[np.ndarray]] = []
    half: list[np.ndarray] = []
    for f, row in enumerate(blocks):
        lower: list[np.ndarray] = [np.zeros(0)] * len(row)
        diagonal, rest = row[0].copy(), right[f].copy()
        for k in range(len(row) - 1, 0, -1):
            before, block = factor[f - k], row[k].copy()
            for m in range(k + 1, min(len(row), k + len(before))):
                block -= lower[m] @ before[m - k].T
            lower[k] = solve_triangular(before[0], block.T, lower=True, check_finite=False).T
            diagonal -= lower[k] @ lower[k].T
            rest -= lower[k] @ half[f - k]
        lower[0] = cholesky(diagonal, lower=True, check_finite=False)
        factor.append(lower)
        half.append(solve_triangular(lower[0], rest, lower=True, check_finite=False))
    result = half
    for f in range(len(blocks) - 1, -1, -1):
        own = factor[f]
        result[f] = solve_triangular(own[0], half[f], lower=True, trans="T", check_finite=False)
        for k in range(1, len(own)):
            result[f - k] = result[f - k] - own[k].T @ result[f]
    return result
