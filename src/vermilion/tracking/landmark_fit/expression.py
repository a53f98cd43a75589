"""Pose and blend weights of a whole take from its landmarks (Mono13 6, full perspective).

Gauss-Newton solves all frames at once. The energy is

    sum over frames and landmarks of rho(|whitened residual|)       rho: Cauchy
    + sum over frames of |w_f|^2 / weight_sigma^2                    w in [0, 1]
    + sum over frames of |acceleration of pose and weights|^2        over their typical sizes

Smoothing is symmetric in time: it does not lag. It ends at cuts and lets fast motion through (`smoothness`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vermilion.geometry.rotations import exp_about_mean, log_about_mean
from vermilion.tracking.landmark_fit.banded_qp import BandMatrix, solve_in_box
from vermilion.tracking.landmark_fit.observation import (
    LandmarkNoise,
    Observations,
    pose_jacobian,
    project,
    projection_jacobian,
    reprojection_px,
    require_landmarks,
    robust_cost,
    robust_weights,
    whitening,
)
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.landmark_fit.smoothness import (
    TemporalSmoothness,
    fast_shapes,
)
from vermilion.tracking.landmark_fit.start import fill_gaps, first_guess
from vermilion.tracking.landmark_fit.timeline import Timeline
from vermilion.tracking.landmark_fit.weight_prior import weight_sigmas

N_POSE = 6
_FRAMES_AT_ONCE = 256


@dataclass(frozen=True)
class LandmarkFitSettings:
    """What is typical of landmarks, faces and heads; the same for everybody.

    Attributes:
        noise: of the landmarks.
        rotation_acceleration_deg, translation_acceleration_mm, weight_acceleration: typical
            accelerations, per second squared; infinite switches smoothness off.
        fast_limit: lids or mouth that accelerate this many times as much as noise does are half free.
        weight_sigma, lid_weight_sigma, side_weight_share, rare_weight_share: `WeightPrior`.
        jaw_slide: weight of the residual along the jaw line, 0 (slides freely) to 1.
        iterations, tolerance_mm: Gauss-Newton steps at most; stop when no landmark moves more.
    """

    noise: LandmarkNoise = field(default_factory=LandmarkNoise)
    weight_sigma: float = 0.5
    rotation_acceleration_deg: float = 400.0
    translation_acceleration_mm: float = 600.0
    weight_acceleration: float = 40.0
    fast_limit: float = 3.5
    lid_weight_sigma: float = 1.0
    side_weight_share: float = 0.2
    rare_weight_share: float = 0.4
    jaw_slide: float = 0.1
    iterations: int = 15
    tolerance_mm: float = 0.01

    def typical_acceleration(self, n_weights: int) -> np.ndarray:
        """(6 + K,) of pose and K = `n_weights` blend weights, per second squared."""
        turn, move = np.radians(self.rotation_acceleration_deg), self.translation_acceleration_mm
        return np.repeat([turn, move, self.weight_acceleration], [3, 3, n_weights])

    def smoothness(
        self, shape: LandmarkShape, timeline: Timeline, known: np.ndarray, weights: np.ndarray
    ) -> TemporalSmoothness:
        """Of pose and `weights` (F, K), those of each frame by itself; `known` (F,) bind their neighbours."""
        fast = fast_shapes(shape, shape.sigma_mm(self.noise), self.weight_sigma)
        typical = self.typical_acceleration(shape.n_expressions)
        return TemporalSmoothness.of(typical, timeline, known, weights, fast, self.fast_limit)

    def weight_sigmas(self, names: Sequence[str], n_weights: int) -> np.ndarray:
        """(K,) deviations of K = `n_weights` blend weights about zero; `names` of the shapes, or none."""
        return weight_sigmas(names, n_weights, self)


@dataclass(frozen=True)
class HeadMotion:
    """Pose and expression of each frame.

    Attributes:
        rotation: (F, 3, 3) camera from head.
        translation_mm: (F, 3) of the head in the camera frame.
        weights: (F, K) in [0, 1].
        reprojection_px: (F,) RMS over all landmarks except the jaw's; NaN where the landmarks were
            not found.
    """

    rotation: np.ndarray
    translation_mm: np.ndarray
    weights: np.ndarray
    reprojection_px: np.ndarray


def fit_motion(
    shape: LandmarkShape,
    seen: Observations,
    focal_px: float,
    timeline: Timeline | float,
    settings: LandmarkFitSettings | None = None,
) -> HeadMotion:
    """Fit all frames of a take. Frames without landmarks are interpolated between those of their piece.

    Args:
        shape: the person's landmarks.
        seen: F frames.
        focal_px: of the camera.
        timeline: of the F frames; or frames a second, of evenly spaced frames without a cut.
        settings: noise and priors.

    Raises:
        InputError: no frame has landmarks.
    """
    settings = settings or LandmarkFitSettings()
    if not isinstance(timeline, Timeline):
        timeline = Timeline.of(len(seen.image), timeline)
    problem = _TakeProblem(shape, seen, focal_px, timeline, settings)
    x = problem.first_guess()
    cost = problem.cost(x)
    for _ in range(settings.iterations):
        target = problem.quadratic_minimum(x)
        for scale in (1.0, 0.5, 0.25, 0.1):
            trial = x + scale * (target - x)
            trial_cost = problem.cost(trial)
            if trial_cost <= cost:
                break
        else:
            break
        moved = problem.largest_move_mm(x, trial)
        x, cost = trial, trial_cost
        if moved < settings.tolerance_mm:
            break
    return problem.motion(x)


class _TakeProblem:
    """The energy above; unknowns x (F, 6 + K): rotation vector, translation, weights."""

    def __init__(
        self,
        shape: LandmarkShape,
        seen: Observations,
        focal_px: float,
        timeline: Timeline,
        settings: LandmarkFitSettings,
    ):
        require_landmarks([seen])
        self.shape, self.seen, self.focal, self.settings = shape, seen, focal_px, settings
        self.n_frames, self.n_weights = len(seen.image), shape.n_expressions
        self.sigma_mm = shape.sigma_mm(settings.noise)
        sigmas = settings.weight_sigmas(shape.expression_names, self.n_weights)
        self.prior = np.concatenate([np.zeros(N_POSE), sigmas**-2.0])
        self.lower = np.concatenate([np.full(N_POSE, -np.inf), np.zeros(self.n_weights)])
        self.upper = np.concatenate([np.full(N_POSE, np.inf), np.ones(self.n_weights)])
        self.timeline = timeline
        # Across gaps: straight lines, which cannot overshoot.
        typical = settings.typical_acceleration(self.n_weights)
        strength = np.maximum((timeline.fps**2 / typical) ** 2, 1e-6)
        self.first = np.maximum(timeline.bridges(seen.valid)[:, None] * strength, 1e-12)

    def first_guess(self) -> np.ndarray:
        """(F, 6 + K) of each frame fitted independently, gaps interpolated."""
        known = np.flatnonzero(self.seen.valid)
        focal = np.full(len(known), self.focal)
        rotation, translation, weights = first_guess(
            self.shape, self.seen[known], self.sigma_mm, focal, self.settings.weight_sigma
        )
        # Fixed from here on: deviations that grew as the head came nearer would pull it nearer.
        piece = self.timeline.piece
        scale = fill_gaps(self.focal / translation[:, 2:], known, piece)
        self.sigma_px = self.sigma_mm * scale
        vectors, self.reference = log_about_mean(rotation)
        values = np.concatenate([vectors, translation, weights], axis=1)
        x = fill_gaps(values, known, piece)
        known, weights = self.seen.valid, x[:, N_POSE:]
        self.smoothness = self.settings.smoothness(self.shape, self.timeline, known, weights)
        return x

    def _camera_points(self, x: np.ndarray) -> np.ndarray:
        rotation = exp_about_mean(x[:, :3], self.reference)
        points = self.shape.points(x[:, N_POSE:])
        return points @ np.swapaxes(rotation, 1, 2) + x[:, None, 3:6]

    def cost(self, x: np.ndarray) -> float:
        """The energy at x (F, 6 + K)."""
        total = landmark_cost(
            self._camera_points(x), self.seen, self.focal, self.sigma_px, self.settings
        )
        total += 0.5 * (self.prior * x**2).sum()
        total += 0.5 * (self.first * np.diff(x, axis=0) ** 2).sum()
        return float(total) + self.smoothness.cost(x)

    def quadratic_minimum(self, x: np.ndarray) -> np.ndarray:
        """Minimum (F, 6 + K), within the box, of the energy's quadratic model at x (F, 6 + K)."""
        blocks, right = self._data_terms(x)
        diagonal = np.arange(N_POSE + self.n_weights)
        blocks[:, diagonal, diagonal] += self.prior
        matrix = BandMatrix(blocks, self.smoothness.weights, self.first, self.timeline.stencils)
        return solve_in_box(matrix, right, self.lower, self.upper, start=x)

    def _data_terms(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        blocks, right = [], []
        for begin in range(0, self.n_frames, _FRAMES_AT_ONCE):
            frames = slice(begin, min(begin + _FRAMES_AT_ONCE, self.n_frames))
            block, gradient = landmark_equations(
                self.shape, self.seen[frames], self.focal, self.sigma_px[frames], self.reference,
                x[frames], self.settings,
            )  # fmt: skip
            blocks.append(block)
            right.append((block @ x[frames][..., None])[..., 0] - gradient)
        return np.concatenate(blocks), np.concatenate(right)

    def largest_move_mm(self, a: np.ndarray, b: np.ndarray) -> float:
        """Largest distance of a landmark between states a (F, 6 + K) and b (F, 6 + K)."""
        return float(np.linalg.norm(self._camera_points(a) - self._camera_points(b), axis=-1).max())

    def motion(self, x: np.ndarray) -> HeadMotion:
        """Pose and expression of the state x (F, 6 + K)."""
        image = project(self._camera_points(x), self.focal)
        reprojection = reprojection_px(image, self.seen)
        rotation = exp_about_mean(x[:, :3], self.reference)
        return HeadMotion(rotation, x[:, 3:6].copy(), x[:, N_POSE:].copy(), reprojection)


def landmark_cost(
    points_mm: np.ndarray,
    seen: Observations,
    focal_px: float,
    sigma_px: np.ndarray,
    settings: LandmarkFitSettings,
) -> float:
    """Landmark term of the energy.

    Args:
        points_mm: (F, N, 3) the model's landmarks, camera frame.
        seen: F frames.
        focal_px: of the camera.
        sigma_px: (F, N) deviations of the detected landmarks.
        settings: of the fit.
    """
    _, residual = _whitened(points_mm, seen, focal_px, sigma_px, settings)
    return float(robust_cost(residual, settings.noise.robust_sigmas).sum())


def landmark_equations(
    shape: LandmarkShape,
    seen: Observations,
    focal_px: float,
    sigma_px: np.ndarray,
    reference: np.ndarray,
    x: np.ndarray,
    settings: LandmarkFitSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Newton matrices (F, P, P) and gradients (F, P) of the landmark term.

    Args:
        sigma_px: (F, N) deviations of the detected landmarks.
        reference: (3, 3) rotation that the rotation vectors are relative to.
        x: (F, P) rotation vector, translation, weights; P = 6 + K.
    """
    turned, by_rotation = pose_jacobian(x[:, :3], reference, shape.points(x[:, N_POSE:]))
    points = turned + x[:, None, 3:6]
    white, residual = _whitened(points, seen, focal_px, sigma_px, settings)
    by_point = white @ projection_jacobian(points, focal_px)
    by_head = by_point @ exp_about_mean(x[:, :3], reference)[:, None]
    by_weight = np.einsum("fnij,knj->fnik", by_head, shape.expressions_mm, optimize=True)
    jacobian = np.concatenate([by_point @ by_rotation, by_point, by_weight], axis=-1)
    jacobian = jacobian.reshape(len(x), -1, jacobian.shape[-1])
    weight = np.repeat(robust_weights(residual, settings.noise.robust_sigmas), 2, axis=1)
    weighted = jacobian * weight[..., None]
    gradient = (residual.reshape(len(x), 1, -1) @ weighted)[:, 0]
    return np.swapaxes(weighted, 1, 2) @ jacobian, gradient


def _whitened(
    points_mm: np.ndarray,
    seen: Observations,
    focal_px: float,
    sigma_px: np.ndarray,
    settings: LandmarkFitSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Whitening matrices (F, N, 2, 2) and whitened residuals (F, N, 2)."""
    image = project(points_mm, focal_px)
    jaw = seen.landmark_set.jaw
    white = whitening(image, sigma_px, seen.trust, settings.jaw_slide, jaw)
    return white, (white @ (image - seen.image)[..., None])[..., 0]
