"""The face model at its landmarks: all that a landmark fit needs of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.landmarks.sets import IBUG66, LandmarkSet
from vermilion.tracking.landmark_fit.observation import LandmarkNoise
from vermilion.tracking.places import LandmarkPlaces


@dataclass(frozen=True)
class LandmarkShape:
    """A person's landmarks as neutral + expressions, linear, in the head frame.

    Attributes:
        neutral_mm: (N, 3).
        expressions_mm: (K, N, 3).
        landmark_set: what the N landmarks are.
        known: (N,) bool, landmarks that the model has a place for; None: all.
        expression_names: K names, which say what moves fast; empty: nothing does.
    """

    neutral_mm: np.ndarray
    expressions_mm: np.ndarray
    landmark_set: LandmarkSet = IBUG66
    known: np.ndarray | None = None
    expression_names: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        model: FaceModel,
        identity: np.ndarray | None = None,
        offset_mm: np.ndarray | None = None,
        places: LandmarkPlaces | None = None,
    ) -> LandmarkShape:
        """Landmarks of a person.

        Args:
            model: the face model.
            identity: (I,) in standard deviations; the mean face by default.
            offset_mm: (N, 3) head frame, as `Identity.landmark_offset_mm`; zero by default.
            places: of the landmarks on the model; None: the 66 vertices that it names.
        """
        neutral = landmark_neutral(model, places)
        if identity is not None and len(identity):
            neutral = neutral + np.tensordot(identity, landmark_identities(model, places), axes=1)
        if offset_mm is not None:
            neutral = neutral + offset_mm
        expressions = _at_landmarks(model.expressions_mm, model, places)
        names = tuple(model.expression_names)
        if places is None:
            return cls(neutral, expressions, expression_names=names)
        return cls(neutral, expressions, places.landmark_set, places.known, names)

    @property
    def n_expressions(self) -> int:
        return len(self.expressions_mm)

    @property
    def interocular_mm(self) -> float:
        """Distance of the outer eye corners."""
        corners = self.neutral_mm[self.landmark_set.eye_corners]
        return float(np.linalg.norm(corners[0] - corners[1]))

    def sigma_mm(self, noise: LandmarkNoise) -> np.ndarray:
        """Deviations (N,) of the landmarks at the head; infinite where the model has no place."""
        sigma = noise.per_landmark(self.landmark_set) * self.interocular_mm
        return sigma if self.known is None else np.where(self.known, sigma, np.inf)

    def points(self, weights: np.ndarray) -> np.ndarray:
        """Landmarks (..., N, 3) of `weights` (..., K), head frame."""
        return self.neutral_mm + np.tensordot(weights, self.expressions_mm, axes=(-1, 0))


def landmark_neutral(model: FaceModel, places: LandmarkPlaces | None = None) -> np.ndarray:
    """Landmarks (N, 3) mm of the mean face, head frame."""
    return _at_landmarks(model.neutral_mm, model, places)


def landmark_identities(model: FaceModel, places: LandmarkPlaces | None = None) -> np.ndarray:
    """Displacements (I, N, 3) mm of the landmarks at one standard deviation of each mode."""
    return _at_landmarks(model.identities_mm, model, places)


def _at_landmarks(field: np.ndarray, model: FaceModel, places: LandmarkPlaces | None) -> np.ndarray:
    """A field (..., V, 3) at the landmarks, (..., N, 3) float64."""
    if places is None:
        return field[..., model.landmarks, :].astype(np.float64)
    return places.of(field)


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
