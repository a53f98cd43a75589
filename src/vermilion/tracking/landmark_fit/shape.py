"""The face model at its landmarks: all that fitting to landmarks needs of it."""

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
        """Landmarks of a person; `offset_mm` (66, 3) as `Identity.landmark_offset_mm`."""
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
        """Landmarks (..., 66, 3) of weights (..., K)."""
        return self.neutral_mm + np.tensordot(weights, self.expressions_mm, axes=(-1, 0))


def landmark_neutral(model: FaceModel) -> np.ndarray:
    """(66, 3) landmarks of the mean face."""
    return model.neutral_mm[model.landmarks].astype(np.float64)


def landmark_identities(model: FaceModel) -> np.ndarray:
    """(I, 66, 3) displacements at one standard deviation."""
    return model.identities_mm[:, model.landmarks].astype(np.float64)


def without_uniform_scale(displacements_mm: np.ndarray, neutral_mm: np.ndarray) -> np.ndarray:
    """Displacements (I, N, 3) less their share of uniform growth of the neutral (N, 3).

    One camera cannot tell a small near head from a large far one. Left in, growth would be set by
    what it does to the blend weights: on a smaller head the same motion needs smaller ones.
    """
    centred = neutral_mm - neutral_mm.mean(axis=0)
    return (
        displacements_mm
        - uniform_scale_share(displacements_mm, neutral_mm)[:, None, None] * centred
    )


def uniform_scale_share(displacements_mm: np.ndarray, neutral_mm: np.ndarray) -> np.ndarray:
    """Share (I,) of uniform growth of the neutral (N, 3) in displacements (I, N, 3)."""
    centred = neutral_mm - neutral_mm.mean(axis=0)
    return np.tensordot(displacements_mm, centred, axes=([1, 2], [0, 1])) / (centred**2).sum()
