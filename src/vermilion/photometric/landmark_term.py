"""The landmarks of one frame as part of its energy: the same terms as in the landmark fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.tracking.expression import N_POSE
from vermilion.tracking.observation import (
    Observations,
    pose_jacobian,
    project,
    projection_jacobian,
    robust_cost,
    robust_weights,
    whitening,
)
from vermilion.tracking.pose import rotation_of
from vermilion.tracking.settings import FitSettings
from vermilion.tracking.shape import LandmarkShape


@dataclass(frozen=True)
class LandmarkTerm:
    """Landmarks of one frame against the model's.

    Attributes:
        shape: the person's landmarks.
        seen: one frame.
        focal_px: of the camera.
        sigma_px: (66,) deviations.
        settings: of the landmark fit.
    """

    shape: LandmarkShape
    seen: Observations
    focal_px: float
    sigma_px: np.ndarray
    settings: FitSettings

    @classmethod
    def of(
        cls,
        shape: LandmarkShape,
        seen: Observations,
        focal_px: float,
        depth_mm: float,
        settings: FitSettings,
    ) -> LandmarkTerm:
        """With deviations that are a share of the inter-ocular distance at `depth_mm`."""
        corners = shape.neutral_mm[[36, 45]]
        interocular_mm = float(np.linalg.norm(corners[0] - corners[1]))
        sigma = settings.noise.per_landmark() * interocular_mm * focal_px / depth_mm
        return cls(shape, seen, focal_px, sigma[None], settings)

    def cost(self, x: np.ndarray, reference: np.ndarray) -> float:
        """Of unknowns x (6 + K): rotation vector about `reference` (3, 3), translation, weights."""
        rotation = rotation_of(x[:3]) @ reference
        points = self.shape.points(x[N_POSE:]) @ rotation.T + x[3:6]
        _, residual = self._whitened(points[None])
        return float(robust_cost(residual, self.settings.noise.robust_sigmas).sum())

    def normal_equations(
        self, x: np.ndarray, reference: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gauss-Newton matrix (P, P) and gradient (P,) at x (P,)."""
        turned, by_rotation = pose_jacobian(
            x[None, :3], reference, self.shape.points(x[N_POSE:])[None]
        )
        points = turned + x[None, None, 3:6]
        white, residual = self._whitened(points)
        by_point = white @ projection_jacobian(points, self.focal_px)
        by_head = by_point @ (rotation_of(x[:3]) @ reference)
        by_weight = np.einsum("fnij,knj->fnik", by_head, self.shape.expressions_mm)
        jacobian = np.concatenate([by_point @ by_rotation, by_point, by_weight], axis=-1)
        jacobian = jacobian.reshape(-1, jacobian.shape[-1])
        weight = np.repeat(robust_weights(residual, self.settings.noise.robust_sigmas)[0], 2)
        weighted = jacobian * weight[:, None]
        return weighted.T @ jacobian, weighted.T @ residual.reshape(-1)

    def _whitened(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        image = project(points, self.focal_px)
        white = whitening(image, self.sigma_px, self.seen.trust, self.settings.jaw_slide)
        return white, (white @ (image - self.seen.image)[..., None])[..., 0]
