"""The landmark term of one frame's energy: the same as in the landmark fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.geometry.rotations import rotation_matrix
from vermilion.tracking.landmark_fit.expression import (
    N_POSE,
    LandmarkFitSettings,
    landmark_cost,
    landmark_equations,
)
from vermilion.tracking.landmark_fit.observation import Observations
from vermilion.tracking.landmark_fit.shape import LandmarkShape


@dataclass(frozen=True)
class LandmarkTerm:
    """Landmarks of one frame against the model's.

    Attributes:
        shape: the person's landmarks.
        seen: landmarks of the frame.
        focal_px: of the camera.
        sigma_px: (1, N) deviations of the detected landmarks.
        settings: of the landmark fit.
    """

    shape: LandmarkShape
    seen: Observations
    focal_px: float
    sigma_px: np.ndarray
    settings: LandmarkFitSettings

    @classmethod
    def of(
        cls,
        shape: LandmarkShape,
        seen: Observations,
        focal_px: float,
        depth_mm: float,
        settings: LandmarkFitSettings,
    ) -> LandmarkTerm:
        """The term whose deviations are a share of the inter-ocular distance at `depth_mm`."""
        sigma = shape.sigma_mm(settings.noise) * focal_px / depth_mm
        return cls(shape, seen, focal_px, sigma[None], settings)

    def cost(self, x: np.ndarray, reference: np.ndarray) -> float:
        """Cost at x (P,): rotation vector about `reference` (3, 3), translation, weights."""
        points = self.shape.points(x[N_POSE:]) @ (rotation_matrix(x[:3]) @ reference).T + x[3:6]
        return landmark_cost(points[None], self.seen, self.focal_px, self.sigma_px, self.settings)

    def normal_equations(
        self, x: np.ndarray, reference: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gauss-Newton matrix (P, P) and gradient (P,) at x (P,), about `reference` (3, 3)."""
        matrix, gradient = landmark_equations(
            self.shape, self.seen, self.focal_px, self.sigma_px, reference, x[None], self.settings
        )
        return matrix[0], gradient[0]
