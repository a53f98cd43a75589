"""Pose and blend weights of a whole take from its landmarks (Mono13 6, full perspective).

All frames are solved at once, by Gauss-Newton on

    sum over frames and landmarks of rho(|whitened residual|)       rho: Cauchy
    + sum over frames of |w_f|^2 / weight_sigma^2                    w in [0, 1]
    + sum over frames of |second difference of pose and weights|^2   over their typical sizes

Being symmetric in time, smoothing does not lag.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vermilion.errors import InputError
from vermilion.tracking.band import BandMatrix, solve_in_box
from vermilion.tracking.observation import (
    LandmarkNoise,
    Observations,
    pose_jacobian,
    project,
    projection_jacobian,
    robust_cost,
    robust_weights,
    whitening,
)
from vermilion.tracking.shape import LandmarkShape
from vermilion.tracking.start import fill_gaps, first_guess, in_chart, out_of_chart

N_POSE = 6
_FRAMES_AT_ONCE = 256


@dataclass(frozen=True)
class FitSettings:
    """What is typical of landmarks, faces and heads; the same for everybody.

    Attributes:
        noise: of the landmarks.
        weight_sigma: deviation of a blend weight about zero.
        rotation_acceleration_deg, translation_acceleration_mm, weight_acceleration: typical
            accelerations, per second squared; infinite switches smoothness off.
        jaw_slide: how far the position along the jaw's line counts, 0 to 1.
        iterations: of Gauss-Newton, at most.
        tolerance_mm: stop when no landmark moves more.
    """

    noise: LandmarkNoise = field(default_factory=LandmarkNoise)
    weight_sigma: float = 0.5
    rotation_acceleration_deg: float = 400.0
    translation_acceleration_mm: float = 600.0
    weight_acceleration: float = 60.0
    jaw_slide: float = 0.1
    iterations: int = 15
    tolerance_mm: float = 0.01


@dataclass(frozen=True)
class HeadMotion:
    """Pose and expression of each frame.

    Attributes:
        rotation: (F, 3, 3) camera from head.
        translation_mm: (F, 3).
        weights: (F, K) in [0, 1].
        reprojection_px: (F,) root mean square over the landmarks but the jaw's; NaN where the
            landmarks were not found.
    """

    rotation: np.ndarray
    translation_mm: np.ndarray
    weights: np.ndarray
    reprojection_px: np.ndarray


def fit_motion(
    shape: LandmarkShape,
    seen: Observations,
    focal_px: float,
    fps: float,
    settings: FitSettings | None = None,
) -> HeadMotion:
    """Fit all frames of a take. Frames without landmarks are interpolated.

    Raises InputError where no frame has landmarks.
    """
    settings = settings or FitSettings()
    problem = _TakeProblem(shape, seen, focal_px, fps, settings)
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

    def __init__(self, shape, seen, focal_px, fps, settings):
        if not seen.valid.any():
            raise InputError(
                "no frame with landmarks",
                "a face in at least one frame",
                "Look at the landmark overlays; check the detector's settings.",
            )
        self.shape, self.seen, self.focal, self.settings = shape, seen, focal_px, settings
        self.n_frames, self.n_weights = len(seen.image), shape.n_expressions
        corners = shape.neutral_mm[[36, 45]]
        self.interocular_mm = float(np.linalg.norm(corners[0] - corners[1]))
        self.sigma_mm = settings.noise.per_landmark() * self.interocular_mm
        self.prior = np.zeros(N_POSE + self.n_weights)
        self.prior[N_POSE:] = settings.weight_sigma**-2.0
        self.lower = np.concatenate([np.full(N_POSE, -np.inf), np.zeros(self.n_weights)])
        self.upper = np.concatenate([np.full(N_POSE, np.inf), np.ones(self.n_weights)])
        self.second, self.first = self._smoothness(fps)

    def _smoothness(self, fps: float) -> tuple[np.ndarray, np.ndarray]:
        s = self.settings
        typical = np.concatenate(
            [
                np.full(3, np.radians(s.rotation_acceleration_deg)),
                np.full(3, s.translation_acceleration_mm),
                np.full(self.n_weights, s.weight_acceleration),
            ]
        )
        strength = (fps**2 / typical) ** 2
        valid = self.seen.valid
        triples = valid[:-2] & valid[1:-1] & valid[2:]
        # Across gaps: straight lines, which cannot overshoot.
        pairs = ~(valid[:-1] & valid[1:])
        floor = 1e-12
        first = np.maximum(pairs[:, None] * np.maximum(strength, 1e-6), floor)
        return triples[:, None] * strength, first

    def first_guess(self) -> np.ndarray:
        known = np.flatnonzero(self.seen.valid)
        focal = np.full(len(known), self.focal)
        rotation, translation, weights = first_guess(
            self.shape, self.seen[known], self.sigma_mm, focal, self.settings.weight_sigma
        )
        # Fixed from here on: deviations that grew as the head came nearer would pull it nearer.
        scale = fill_gaps(self.focal / translation[:, 2:], known, self.n_frames)
        self.sigma_px = self.sigma_mm * scale
        vectors, self.reference = in_chart(rotation)
        values = np.concatenate([vectors, translation, weights], axis=1)
        return fill_gaps(values, known, self.n_frames)

    def _camera_points(self, x: np.ndarray) -> np.ndarray:
        rotation = out_of_chart(x[:, :3], self.reference)
        points = self.shape.points(x[:, N_POSE:])
        return points @ np.swapaxes(rotation, 1, 2) + x[:, None, 3:6]

    def _whitened(
        self, points: np.ndarray, frames: slice
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        image = project(points, self.focal)
        white = whitening(
            image, self.sigma_px[frames], self.seen.trust[frames], self.settings.jaw_slide
        )
        residual = (white @ (image - self.seen.image[frames])[..., None])[..., 0]
        return image, white, residual

    def cost(self, x: np.ndarray) -> float:
        _, _, residual = self._whitened(self._camera_points(x), slice(None))
        total = robust_cost(residual, self.settings.noise.robust_sigmas).sum()
        total += 0.5 * (self.prior * x**2).sum()
        total += 0.5 * (self.first * np.diff(x, axis=0) ** 2).sum()
        if self.n_frames > 2:
            total += 0.5 * (self.second * np.diff(x, n=2, axis=0) ** 2).sum()
        return float(total)

    def quadratic_minimum(self, x: np.ndarray) -> np.ndarray:
        """Minimum, within the box, of the energy's quadratic model at x."""
        blocks, right = self._data_terms(x)
        diagonal = np.arange(N_POSE + self.n_weights)
        blocks[:, diagonal, diagonal] += self.prior
        matrix = BandMatrix(blocks, self.second, self.first)
        return solve_in_box(matrix, right, self.lower, self.upper, start=x)

    def _data_terms(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        blocks, right = [], []
        for begin in range(0, self.n_frames, _FRAMES_AT_ONCE):
            frames = slice(begin, min(begin + _FRAMES_AT_ONCE, self.n_frames))
            jacobian, residual = self._linearised(x[frames], frames)
            weight = np.repeat(
                robust_weights(residual, self.settings.noise.robust_sigmas), 2, axis=1
            )
            flat = residual.reshape(len(residual), -1)
            weighted = jacobian * weight[..., None]
            block = np.swapaxes(weighted, 1, 2) @ jacobian
            gradient = (flat[:, None] @ weighted)[:, 0]
            blocks.append(block)
            right.append((block @ x[frames][..., None])[..., 0] - gradient)
        return np.concatenate(blocks), np.concatenate(right)

    def _linearised(self, x: np.ndarray, frames: slice) -> tuple[np.ndarray, np.ndarray]:
        """Whitened residuals (F, 66, 2) and their Jacobian (F, 132, 6 + K)."""
        turned, by_rotation = pose_jacobian(
            x[:, :3], self.reference, self.shape.points(x[:, N_POSE:])
        )
        points = turned + x[:, None, 3:6]
        _, white, residual = self._whitened(points, frames)
        by_point = white @ projection_jacobian(points, self.focal)
        rotation = out_of_chart(x[:, :3], self.reference)
        by_head = by_point @ rotation[:, None]
        by_weight = np.einsum("fnij,knj->fnik", by_head, self.shape.expressions_mm, optimize=True)
        jacobian = np.concatenate([by_point @ by_rotation, by_point, by_weight], axis=-1)
        return jacobian.reshape(len(x), -1, jacobian.shape[-1]), residual

    def largest_move_mm(self, a: np.ndarray, b: np.ndarray) -> float:
        return float(np.linalg.norm(self._camera_points(a) - self._camera_points(b), axis=-1).max())

    def motion(self, x: np.ndarray) -> HeadMotion:
        image = project(self._camera_points(x), self.focal)
        squared = ((image - self.seen.image) ** 2).sum(axis=-1)[:, 17:]
        reprojection = np.where(self.seen.valid, np.sqrt(squared.mean(axis=1)), np.nan)
        rotation = out_of_chart(x[:, :3], self.reference)
        return HeadMotion(rotation, x[:, 3:6].copy(), x[:, N_POSE:].copy(), reprojection)
