"""Reduced linear regression from trusted to predicted gradients (Guided18 section 4).

With k training frames, Y (9m, k) and X (9n, k), the regression min |theta Y - X|^2 has 81 m n
unknowns. The paper's reduction: Y = U_Y C_Y and X = U_X C_X by SVDs, then the k x k system

    theta_r C_Y C_Y^T = C_X C_Y^T,      theta = U_X theta_r U_Y^T,

whose theta is the minimum-norm solution. The large matrix is never formed: a frame costs two
products with k columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from vermilion.storage.errors import InputError, ModelFileError

FORMAT_VERSION = 1
#: Singular values below this share of the largest say only that frames are equal.
_LEAST_SHARE = 1e-7
#: Under this share of the largest eigenvalue one pass is orthonormal to less than about 1e-9.
_ONE_PASS = 1e-7


@dataclass(frozen=True)
class ReducedBasis:
    """A thin singular value decomposition A = U C of k columns.

    Attributes:
        directions: (r, N) orthonormal rows, U^T.
        coefficients: (r, k), C = Sigma V^T.
    """

    directions: np.ndarray
    coefficients: np.ndarray


def reduced_basis(columns: np.ndarray) -> ReducedBasis:
    """Thin SVD of A given as its transpose, columns (k, N), N much larger than k.

    From the k x k matrix A^T A, and where frames are alike once more from the result: the second
    pass makes the directions orthonormal to rounding. A fifth of the time of LAPACK's SVD. Frames
    that are equal leave r < k.
    """
    values, vectors = np.linalg.eigh(columns @ columns.T)
    keep = values > _LEAST_SHARE**2 * max(values[-1], 1e-300)
    kept = (vectors[:, keep] / np.sqrt(values[keep]))[:, ::-1]
    directions = kept.T @ columns
    if keep.any() and values[keep][0] < _ONE_PASS * values[-1]:
        values, vectors = np.linalg.eigh(directions @ directions.T)
        directions = ((vectors / np.sqrt(values)) @ vectors.T) @ directions
    return ReducedBasis(directions, directions @ columns.T)


class ReducedRegression:
    """Linear map from trusted gradients (9m) to predicted ones (9n), learnt from k frames.

    Attributes (fitted):
        trusted_basis_: (r, 9m), U_Y^T.
        predicted_basis_: (s, 9n), U_X^T.
        reduced_: (s, r), theta_r.
        n_frames_: k.
    """

    def fit(self, trusted: np.ndarray, predicted: np.ndarray) -> Self:
        """Learn from k frames.

        Args:
            trusted: (k, 9m), y of each frame.
            predicted: (k, 9n), x of each frame.

        Raises:
            InputError: no frames, another number of them, or a value that is not finite.
        """
        trusted, predicted = (np.asarray(a, dtype=np.float64) for a in (trusted, predicted))
        _check_training(trusted, predicted)
        of_trusted, of_predicted = reduced_basis(trusted), reduced_basis(predicted)
        # The transposed least squares of theta_r C_Y = C_X has the normal equations of the paper.
        solution = np.linalg.lstsq(
            of_trusted.coefficients.T, of_predicted.coefficients.T, rcond=None
        )
        self.trusted_basis_ = of_trusted.directions
        self.predicted_basis_ = of_predicted.directions
        self.reduced_ = solution[0].T
        self.n_frames_ = len(trusted)
        return self

    def predict(self, trusted: np.ndarray) -> np.ndarray:
        """x = U_X theta_r U_Y^T y, (F, 9n), of frames trusted (F, 9m)."""
        self._check_width(trusted)
        return (trusted @ self.trusted_basis_.T @ self.reduced_.T) @ self.predicted_basis_

    def unexplained(self, trusted: np.ndarray, neutral: np.ndarray) -> np.ndarray:
        """What the span of the training leaves of each frame's y, (F,) in [0, 1].

        Args:
            trusted: (F, 9m).
            neutral: (9m,) of the neutral; the difference from it counts as 1.
        """
        self._check_width(trusted)
        whole = np.linalg.norm(trusted - neutral, axis=1)
        # The basis is orthonormal: what is left has the length that Pythagoras leaves.
        inside = trusted @ self.trusted_basis_.T
        squared = np.einsum("fi,fi->f", trusted, trusted) - np.einsum("fr,fr->f", inside, inside)
        outside = np.sqrt(np.maximum(squared, 0.0))
        share = np.divide(outside, whole, out=np.zeros_like(whole), where=whole > 1e-9)
        return np.minimum(share, 1.0)

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything fitted, by name, for a `.npz` (no pickle): bases (r, 9m), (s, 9n), reduced (s, r)."""
        return {
            "regression_version": np.int64(FORMAT_VERSION),
            "trusted_basis": self.trusted_basis_,
            "predicted_basis": self.predicted_basis_,
            "reduced": self.reduced_,
            "n_frames": np.int64(self.n_frames_),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray], path: str | None = None) -> Self:
        """A regression of what `arrays` (r, 9m), ... gave. Raises ModelFileError on another version or a missing array."""
        version = int(arrays.get("regression_version", -1))
        if version != FORMAT_VERSION:
            raise ModelFileError(
                f"reduced regression format {version}",
                f"format {FORMAT_VERSION}",
                "Train it again with this version of Vermilion.",
                path=path,
            )
        missing = {"trusted_basis", "predicted_basis", "reduced", "n_frames"} - set(arrays)
        if missing:
            raise ModelFileError(
                f"no {', '.join(sorted(missing))}",
                "all arrays of a reduced regression",
                "Train it again.",
                path=path,
            )
        result = cls()
        result.trusted_basis_ = arrays["trusted_basis"]
        result.predicted_basis_ = arrays["predicted_basis"]
        result.reduced_ = arrays["reduced"]
        result.n_frames_ = int(arrays["n_frames"])
        return result

    def _check_width(self, trusted: np.ndarray) -> None:
        width = self.trusted_basis_.shape[1]
        if trusted.ndim != 2 or trusted.shape[1] != width:
            raise InputError(
                f"trusted gradients of shape {trusted.shape}",
                f"(frames, {width})",
                "Use the regions that the regression was trained with.",
            )


def _check_training(trusted: np.ndarray, predicted: np.ndarray) -> None:
    if trusted.ndim != 2 or predicted.ndim != 2 or len(trusted) != len(predicted):
        raise InputError(
            f"trusted gradients {trusted.shape} and predicted ones {predicted.shape}",
            "(k, 9m) and (k, 9n) of the same k frames",
            "Give one row a corrected frame.",
        )
    if len(trusted) == 0:
        raise InputError("no corrected frame", "at least one", "Correct a frame first.")
    bad = np.flatnonzero(~(np.isfinite(trusted).all(axis=1) & np.isfinite(predicted).all(axis=1)))
    if len(bad):
        raise InputError(
            f"training rows {bad.tolist()} with values that are not finite",
            "finite deformation gradients",
            "Leave these frames out, or correct their meshes.",
        )
