"""The matrix of weights that change smoothly, where all frames have the same shapes.

With the shapes' products G (K, K) and the Laplacian L of the path of F frames, it is x -> x G + s L x for weights
x (F, K). G has eigenvectors Q, L the cosine transform: without bounds, both together solve it at once. With some
weights at their bounds that solution preconditions conjugate gradients over the others.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import dct, idct

_STEPS, _EXACT = 300, 1e-9  # of conjugate gradients; and what is left of the right side
_LEAST = 1e-9  # of the largest eigenvalue: shapes that are sums of others have none


class SmoothedGram:
    """A matrix for `solve_in_box`, as `BandMatrix` is one, in a fraction of its memory."""

    def __init__(self, gram: np.ndarray, n_frames: int, smooth: float):
        """Factor.

        Args:
            gram: (K, K) symmetric, positive semidefinite.
            n_frames: F.
            smooth: weight of the squared differences of frames.
        """
        self._gram, self._smooth = gram, smooth
        values, self._vectors = np.linalg.eigh(gram)
        waves = 2.0 - 2.0 * np.cos(np.pi * np.arange(n_frames) / n_frames)
        together = np.maximum(values, 0.0) + smooth * waves[:, None]
        self._inverse = 1.0 / np.maximum(together, _LEAST * max(float(together.max()), 1e-300))

    def times(self, x: np.ndarray) -> np.ndarray:
        """Product (F, K) with x (F, K)."""
        result = x @ self._gram
        steps = self._smooth * np.diff(x, axis=0)
        result[:-1] -= steps
        result[1:] += steps
        return result

    def solve_free(self, right: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Solution (F, K) for `right` (F, K) over the `free` (F, K) bool unknowns, the others zero."""
        left = np.where(free, right, 0.0)
        x, enough = np.zeros_like(left), _EXACT * np.abs(left).max(initial=0.0)
        along = np.zeros_like(left)
        before = 1.0
        for _ in range(_STEPS):
            if np.abs(left).max(initial=0.0) <= enough:
                break
            shown = np.where(free, self._solve(left), 0.0)
            strength = float((left * shown).sum())
            along = shown + strength / before * along
            before = strength
            product = np.where(free, self.times(along), 0.0)
            step = strength / max(float((along * product).sum()), 1e-300)
            x += step * along
            left -= step * product
        return x

    def _solve(self, right: np.ndarray) -> np.ndarray:
        """Solution (F, K) over all unknowns."""
        waves = dct(right @ self._vectors, axis=0, norm="ortho") * self._inverse
        return idct(waves, axis=0, norm="ortho") @ self._vectors.T
