"""The face model at its landmarks: all that a landmark fit needs of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel


@dataclass(frozen=True)
class LandmarkShape:
    """A person's landmarks as neutral + expressions, linear, in the head frame.

    Attributes:
        neutral_mm: (66, 3).
        expressions_mm: (K, 66, 3).
    """

    neutral_mm: np.ndarray
    expressions_mm: np.ndarray

    @classmethod
    def of(
        cls,
        model: FaceModel,
        identity: np.ndarray | None = None,
        offset_mm: np.ndarray | None = None,
    ) -> LandmarkShape:
        """Landmarks of a person.

        Args:
            model: the face model.
            identity: (I,) in standard deviations; the mean face by default.
            offset_mm: (66, 3) head frame, as `Identity.landmark_offset_mm`; zero by default.
        """
        neutral = landmark_neutral(model)
        if identity is not None and len(identity):
            neutral = neutral + np.tensordot(identity, landmark_identities(model), axes=1)
        if offset_mm is not None:
            neutral = neutral + offset_mm
        return cls(neutral, model.expressions_mm[:, model.landmarks].astype(np.float64))

    @property
    def n_expressions(self) -> int:
        return len(self.expressions_mm)

    def points(self, weights: np.ndarray) -> np.ndarray:
        """Landmarks (..., 66, 3) of `weights` (..., K), head frame."""
        return self.neutral_mm + np.tensordot(weights, self.expressions_mm, axes=(-1, 0))


def landmark_neutral(model: FaceModel) -> np.ndarray:
    """Landmarks (66, 3) mm of the mean face, head frame."""
    return model.neutral_mm[model.landmarks].astype(np.float64)


def landmark_identities(model: FaceModel) -> np.ndarray:
    """Displacements (I, 66, 3) mm of the landmarks at one standard deviation of each mode."""
    return model.identities_mm[:, model.landmarks].astype(np.float64)


def without_uniform_scale(displacements_mm: np.ndarray, neutral_mm: np.ndarray) -> np.ndarray:
    """`displacements_mm` (I, N, 3) without their component of uniform scale of `neutral_mm` (N, 3).

    One camera cannot distinguish a small near head from a large far one. With scale left in, the
    prior on the blend weights would choose it: on a smaller head the same motion needs smaller
    weights.
    """
    centred = neutral_mm - neutral_mm.mean(axis=0)
    return (
        displacements_mm
        - uniform_scale_share(displacements_mm, neutral_mm)[:, None, None] * centred
    )


def uniform_scale_share(displacements_mm: np.ndarray, neutral_mm: np.ndarray) -> np.ndarray:
    """Uniform scale (I,) of `neutral_mm` (N, 3) contained in `displacements_mm` (I, N, 3)."""
    centred = neutral_mm - neutral_mm.mean(axis=0)
    return np.tensordot(displacements_mm, centred, axes=([1, 2], [0, 1])) / (centred**2).sum()
