"""Box-constrained quadratic programs over all frames of a take.

The unknowns are x (F, P): P parameters a frame. The matrix has one block a frame, and smoothness
over time that couples each parameter with itself in the next two frames. It is stored as a band, so
that one exact solve covers the whole take and the result does not depend on chunks.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded
from scipy.linalg.lapack import dposv


class ProgramMatrix(Protocol):
    """What `solve_in_box` asks of a symmetric matrix over unknowns (F, P)."""

    def times(self, x: np.ndarray) -> np.ndarray:
        """Product (F, P) with x (F, P)."""

    def solve_free(self, right: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Solution (F, P) for `right` (F, P) over the `free` (F, P) bool unknowns, the others zero."""


class FrameMatrix:
    """The matrix of a single frame, stored in full: a band of one block is slower.

    Args:
        block: (P, P) symmetric, positive definite.
    """

    def __init__(self, block: np.ndarray):
        self.block = block

    def times(self, x: np.ndarray) -> np.ndarray:
        """Product (1, P) with x (1, P)."""
        return x @ self.block

    def solve_free(self, right: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Solution (1, P) for `right` (1, P) over the `free` (1, P) bool unknowns, the others zero."""
        solution, ids = np.zeros_like(right), np.flatnonzero(free[0])
        if len(ids):
            part = self.block[np.ix_(ids, ids)]
            # LAPACK itself: scipy's `solve` takes longer than so small a system.
            _, solution[0, ids], failed = dposv(part, right[0, ids], overwrite_a=True)
            if failed:
                raise LinAlgError("the block of a frame is not positive definite")
        return solution


class BandMatrix:
    """A symmetric matrix in LAPACK's upper banded storage, bandwidth 2 P.

    Args:
        blocks: (F, P, P) symmetric blocks on the diagonal.
        second: (F - 2, P) weights of squared second differences over time.
        first: (F - 1, P) weights of squared first differences over time.
        stencils: (F - 2, 3) factors of the second differences; None: 1, -2, 1.
    """

    def __init__(
        self,
        blocks: np.ndarray,
        second: np.ndarray,
        first: np.ndarray,
        stencils: np.ndarray | None = None,
    ):
        self.n_frames, self.n_params = blocks.shape[:2]
        n, p = self.n_frames, self.n_params
        self.u = 2 * p if n > 2 else (p if n == 2 else p - 1)
        self.band = np.zeros((self.u + 1, n * p))
        rows, columns = np.triu_indices(p)
        at = np.arange(n)[:, None] * p + columns
        self.band[self.u + rows - columns, at] = blocks[:, rows, columns]
        if n > 1:
            self._add_differences(first, np.tile([-1.0, 1.0], (n - 1, 1)))
        if n > 2:
            even = np.tile([1.0, -2.0, 1.0], (n - 2, 1))
            self._add_differences(second, even if stencils is None else stencils)

    def _add_differences(self, weights: np.ndarray, stencils: np.ndarray) -> None:
        """Add sum_f weights[f] (stencils[f] . x[f:])^2 for each parameter.

        `weights` are (n, P), `stencils` (n, frames that a difference takes).
        """
        p = self.n_params
        count, width = stencils.shape
        for i in range(width):
            for j in range(i, width):
                columns = ((np.arange(count) + j)[:, None] * p + np.arange(p)).reshape(-1)
                both = (stencils[:, i] * stencils[:, j])[:, None] * weights
                self.band[self.u - (j - i) * p, columns] += both.reshape(-1)

    def times(self, x: np.ndarray) -> np.ndarray:
        """Product (F, P) with x (F, P)."""
        flat = x.reshape(-1)
        result = self.band[self.u] * flat
        for offset in range(1, self.u + 1):
            diagonal = self.band[self.u - offset, offset:]
            result[:-offset] += diagonal * flat[offset:]
            result[offset:] += diagonal * flat[:-offset]
        return result.reshape(x.shape)

    def solve_free(self, right: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Solution (F, P) for `right` (F, P) over the `free` (F, P) bool unknowns, the others zero."""
        band, fixed = self.band.copy(), ~free.reshape(-1)
        for offset in range(1, self.u + 1):
            row = band[self.u - offset, offset:]
            row[fixed[offset:] | fixed[:-offset]] = 0.0
        band[self.u, fixed] = 1.0
        flat = np.where(fixed, 0.0, right.reshape(-1))
        solution = solveh_banded(band, flat, overwrite_ab=True, check_finite=False)
        return solution.reshape(right.shape)


def solve_in_box(
    matrix: ProgramMatrix,
    right: np.ndarray,
    lower: np.ndarray | float,
    upper: np.ndarray | float,
    start: np.ndarray | None = None,
    iterations: int = 30,
) -> np.ndarray:
    """Minimise x'Ax/2 - b'x with lower <= x <= upper, by projected Newton (Bertsekas 1982).

    Args:
        matrix: A, positive definite.
        right: b, (F, P).
        lower, upper: (P,) or (F, P) or one number, may be infinite.
        start: (F, P) first guess within the box; zero by default.
        iterations: Newton steps, at most.

    Returns:
        x (F, P), within the box.
    """
    lower, upper = np.broadcast_to(lower, right.shape), np.broadcast_to(upper, right.shape)
    x = np.clip(np.zeros_like(right) if start is None else start, lower, upper)
    gradient = matrix.times(x) - right
    for _ in range(iterations):
        held = ((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0))
        step = matrix.solve_free(-gradient, ~held)
        moved = False
        for scale in (1.0, 0.5, 0.25, 0.1, 0.01):
            trial = np.clip(x + scale * step, lower, upper)
            change = trial - x
            product = matrix.times(change)
            if (gradient * change).sum() + 0.5 * (change * product).sum() < 0:
                x, gradient, moved = trial, gradient + product, True
                break
        if not moved or np.abs(change).max() < 1e-10:
            break
    return x
