"""The person from landmarks: identity coefficients over frames of all of a subject's takes.

Gauss-Newton finds identity, landmark offsets, unknown focal lengths, poses and weights together.
The unknowns of the frames are eliminated (Schur complement).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.rotations import log_about_mean, rotation_matrix
from vermilion.tracking.landmark_fit.expression import N_POSE, LandmarkFitSettings
from vermilion.tracking.landmark_fit.gauss_newton import (
    NormalEquations,
    active_bounds,
    gauss_newton,
)
from vermilion.tracking.landmark_fit.observation import (
    LandmarkNoise,
    Observations,
    pose_jacobian,
    project,
    projection_jacobian,
    require_landmarks,
    robust_cost,
    robust_weights,
    whitening,
)
from vermilion.tracking.landmark_fit.shape import (
    LandmarkShape,
    landmark_identities,
    without_uniform_scale,
)
from vermilion.tracking.landmark_fit.start import first_guess
from vermilion.tracking.places import LandmarkPlaces


@dataclass(frozen=True)
class IdentitySettings:
    """Priors of the person; the same for all people.

    Attributes:
        fit: noise of the landmarks and prior of the weights, as in the landmark fit.
        bias: deviation of a person's detected landmarks from the model's that is constant over all
            frames, as fractions of the inter-ocular distance.
        neutral_weight_sigma: deviation of the weights in a frame known to be neutral.
        focal_sigma: deviation of the logarithm of an unknown focal length about its guess.
        iterations: Gauss-Newton steps, at most.
    """

    fit: LandmarkFitSettings = field(default_factory=LandmarkFitSettings)
    bias: LandmarkNoise = field(default_factory=lambda: LandmarkNoise(0.08, 0.05, 0.04, 0.04, 0.04))
    neutral_weight_sigma: float = 0.03
    focal_sigma: float = 0.3
    iterations: int = 60


@dataclass(frozen=True)
class TakeSample:
    """Landmarks of some frames of a take.

    Attributes:
        name: the take.
        seen: landmarks of n frames; frames that are not valid are left out.
        focal_px: focal length, known or first guess.
        calibrated: whether the focal length is known.
        neutral: (n,) bool, which frames show the neutral.
    """

    name: str
    seen: Observations
    focal_px: float
    calibrated: bool
    neutral: np.ndarray


@dataclass(frozen=True)
class IdentityFit:
    """The person.

    Attributes:
        identity: (I,) in standard deviations.
        landmark_offset_mm: (N, 3) in the head frame: the neutral's landmarks as detected, minus
            the model's.
        focal_px: take -> focal length.
        reprojection_px: RMS over all frames and all landmarks except the jaw's.
    """

    identity: np.ndarray
    landmark_offset_mm: np.ndarray
    focal_px: dict[str, float]
    reprojection_px: float


def fit_identity(
    model: FaceModel,
    samples: list[TakeSample],
    settings: IdentitySettings | None = None,
    places: LandmarkPlaces | None = None,
) -> IdentityFit:
    """Fit one person.

    Args:
        places: of the samples' landmarks on the model; None: the 66 vertices that it names.

    Raises:
        InputError: no sampled frame has landmarks.
    """
    problem = IdentityProblem(model, samples, settings or IdentitySettings(), places)
    return problem.result(*problem.solve())


class IdentityProblem:
    """The landmark energy of one person (a `GaussNewtonProblem`).

    Unknowns: `frames` (F, 6 + K) are pose and weights of each frame; `shared` (S,) are identity (I),
    landmark offsets (3 N) and the logarithm of each take's focal length.
    """

    def __init__(
        self,
        model: FaceModel,
        samples: list[TakeSample],
        settings: IdentitySettings,
        places: LandmarkPlaces | None = None,
    ):
        keep = [np.flatnonzero(sample.seen.valid) for sample in samples]
        counts = [len(k) for k in keep]
        require_landmarks([sample.seen for sample in samples])
        self.samples, self.settings = samples, settings
        self.shape = LandmarkShape.of(model, places=places)
        self.landmark_set = self.shape.landmark_set
        self.n_offset = 3 * self.landmark_set.n_points
        self.identities = without_uniform_scale(
            landmark_identities(model, places), self.shape.neutral_mm
        )
        self.n_identity, self.n_weights = len(self.identities), self.shape.n_expressions
        parts = [sample.seen[k] for sample, k in zip(samples, keep, strict=True)]
        self.image = np.concatenate([part.image for part in parts])
        self.trust = np.concatenate([part.trust for part in parts])
        self.take = np.repeat(np.arange(len(samples)), counts)
        self.n_frames = len(self.take)
        neutral = np.concatenate([s.neutral[k] for s, k in zip(samples, keep, strict=True)])
        usual = settings.fit.weight_sigmas(self.shape.expression_names, self.n_weights)
        sigma = np.where(neutral[:, None], settings.neutral_weight_sigma, usual)
        self.frame_prior = np.zeros((self.n_frames, N_POSE + self.n_weights))
        self.frame_prior[:, N_POSE:] = sigma**-2.0
        self.guess = np.log([sample.focal_px for sample in samples])
        self.centre = np.concatenate([np.zeros(self.n_identity + self.n_offset), self.guess])
        # A known focal length is one whose prior is so tight that it cannot move.
        bias_mm = settings.bias.per_landmark(self.landmark_set) * self.shape.interocular_mm
        loose = np.array([not sample.calibrated for sample in samples])
        self.shared_prior = np.concatenate(
            [
                np.ones(self.n_identity),
                np.repeat(bias_mm**-2.0, 3),
                np.where(loose, settings.focal_sigma**-2.0, 1e12),
            ]
        )
        self.sigma_mm = self.shape.sigma_mm(settings.fit.noise)

    def first_guess(self) -> tuple[np.ndarray, np.ndarray]:
        """Frames (F, 6 + K) fitted to the mean face, and shared unknowns (S,) at their priors."""
        valid = np.ones(self.n_frames, dtype=bool)
        seen = Observations(self.image, self.trust, valid, self.landmark_set)
        rotation, translation, weights = first_guess(
            self.shape,
            seen,
            self.sigma_mm,
            np.exp(self.guess)[self.take],
            self.settings.fit.weight_sigma,
        )
        vectors, self.reference = log_about_mean(rotation)
        self.sigma_px = self.sigma_mm * (np.exp(self.guess)[self.take] / translation[:, 2])[:, None]
        frames = np.concatenate([vectors, translation, weights], axis=1)
        return frames, self.centre.copy()

    def _neutral(self, shared: np.ndarray) -> np.ndarray:
        person = np.tensordot(shared[: self.n_identity], self.identities, axes=1)
        return self.shape.neutral_mm + person + self._offset(shared)

    def _offset(self, shared: np.ndarray) -> np.ndarray:
        """(N, 3) mm."""
        return shared[self.n_identity : self.n_identity + self.n_offset].reshape(-1, 3)

    def focal(self, shared: np.ndarray) -> np.ndarray:
        """Focal lengths (F, 1) px of the frames, of `shared` (S,)."""
        return np.exp(shared[self.n_identity + self.n_offset :])[self.take][:, None]

    def _residual(self, points: np.ndarray, focal: np.ndarray):
        image = project(points, focal)
        slide = self.settings.fit.jaw_slide
        white = whitening(image, self.sigma_px, self.trust, slide, self.landmark_set.jaw)
        return image, white, (white @ (image - self.image)[..., None])[..., 0]

    def _camera_points(self, frames: np.ndarray, shared: np.ndarray) -> np.ndarray:
        shape = LandmarkShape(self._neutral(shared), self.shape.expressions_mm)
        rotation = rotation_matrix(frames[:, :3]) @ self.reference
        points = shape.points(frames[:, N_POSE:]) @ np.swapaxes(rotation, 1, 2)
        return points + frames[:, None, 3:6]

    def cost(self, frames: np.ndarray, shared: np.ndarray) -> float:
        """Energy of `frames` (F, 6 + K) and `shared` (S,); infinite behind the camera."""
        points = self._camera_points(frames, shared)
        if (points[..., 2] <= 1.0).any():
            return np.inf
        _, _, residual = self._residual(points, self.focal(shared))
        total = robust_cost(residual, self.settings.fit.noise.robust_sigmas).sum()
        total += 0.5 * (self.frame_prior * frames**2).sum()
        total += 0.5 * (self.shared_prior * (shared - self.centre) ** 2).sum()
        return float(total)

    def _linearised(self, frames: np.ndarray, shared: np.ndarray):
        """Weighted residuals (F, 2 N), Jacobians (F, 2 N, 6 + K) and (F, 2 N, S)."""
        shape = LandmarkShape(self._neutral(shared), self.shape.expressions_mm)
        turned, by_rotation = pose_jacobian(
            frames[:, :3], self.reference, shape.points(frames[:, N_POSE:])
        )
        points = turned + frames[:, None, 3:6]
        focal = self.focal(shared)
        image, white, residual = self._residual(points, focal)
        limit = self.settings.fit.noise.robust_sigmas
        root = np.sqrt(robust_weights(residual, limit))[..., None]
        white, residual = white * root[..., None], residual * root
        by_point = white @ projection_jacobian(points, focal)
        by_head = by_point @ (rotation_matrix(frames[:, :3]) @ self.reference)[:, None]
        by_weight = np.einsum("fnij,knj->fnik", by_head, self.shape.expressions_mm)
        by_frame = np.concatenate([by_point @ by_rotation, by_point, by_weight], axis=-1)
        n = self.n_identity
        by_shared = np.zeros((self.n_frames, self.landmark_set.n_points, 2, len(shared)))
        by_shared[..., :n] = np.einsum("fnij,knj->fnik", by_head, self.identities)
        landmark = np.arange(self.landmark_set.n_points)
        for axis in range(3):
            by_shared[:, landmark, :, n + 3 * landmark + axis] = np.moveaxis(
                by_head[..., axis], 0, 1
            )
        column = n + self.n_offset + self.take
        by_shared[np.arange(self.n_frames), :, :, column] = (white @ image[..., None])[..., 0]
        size = (self.n_frames, 2 * self.landmark_set.n_points)
        return residual.reshape(size), by_frame.reshape(*size, -1), by_shared.reshape(*size, -1)

    def normal_equations(self, frames: np.ndarray, shared: np.ndarray) -> NormalEquations:
        """The system at `frames` (F, 6 + K) and `shared` (S,), without bounds on the weights."""
        residual, by_frame, by_shared = self._linearised(frames, shared)
        blocks = np.swapaxes(by_frame, 1, 2) @ by_frame
        diagonal = np.arange(blocks.shape[1])
        blocks[:, diagonal, diagonal] += self.frame_prior
        flat = by_shared.reshape(-1, by_shared.shape[-1])
        shared_gradient = np.einsum("fr,frs->s", residual, by_shared)
        return NormalEquations(
            blocks,
            np.swapaxes(by_frame, 1, 2) @ by_shared,
            flat.T @ flat + np.diag(self.shared_prior),
            (residual[:, None] @ by_frame)[:, 0] + self.frame_prior * frames,
            shared_gradient + self.shared_prior * (shared - self.centre),
        )

    def newton_step(self, frames: np.ndarray, shared: np.ndarray):
        """Step of `frames` (F, 6 + K) and of `shared` (S,); weights at active bounds stay."""
        found = self.normal_equations(frames, shared)
        held = active_bounds(frames, found.frame_gradient)
        gradient = np.where(held, 0.0, found.frame_gradient)
        coupling = np.where(held[..., None], 0.0, found.coupling)
        blocks = np.where(held[:, None] | held[..., None], 0.0, found.blocks)
        diagonal = np.arange(blocks.shape[1])
        blocks[:, diagonal, diagonal] += np.where(held, 1.0, 0.0)
        blocks[:, diagonal, diagonal] *= 1 + 1e-9
        solved = np.linalg.solve(blocks, np.concatenate([coupling, gradient[..., None]], axis=-1))
        system = found.system - np.einsum("fps,fpt->st", coupling, solved[..., :-1], optimize=True)
        right = np.einsum("fps,fp->s", coupling, solved[..., -1]) - found.shared_gradient
        shared_step = np.linalg.solve(system, right)
        frame_step = -(solved[..., -1] + solved[..., :-1] @ shared_step)
        return np.where(held, 0.0, frame_step), shared_step

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """Frames (F, 6 + K) and shared unknowns (S,) from landmarks alone."""
        frames, shared = self.first_guess()
        return gauss_newton(self, frames, shared, self.settings.iterations)

    def result(self, frames: np.ndarray, shared: np.ndarray) -> IdentityFit:
        """The person of the solution `frames` (F, 6 + K) and `shared` (S,)."""
        image = project(self._camera_points(frames, shared), self.focal(shared))
        squared = ((image - self.image) ** 2).sum(axis=-1)[:, self.landmark_set.compared]
        focal = np.exp(shared[self.n_identity + self.n_offset :])
        known = [
            s.focal_px if s.calibrated else f for s, f in zip(self.samples, focal, strict=True)
        ]
        return IdentityFit(
            identity=shared[: self.n_identity].copy(),
            landmark_offset_mm=self._offset(shared),
            focal_px={s.name: float(f) for s, f in zip(self.samples, known, strict=True)},
            reprojection_px=float(np.sqrt(squared.mean())),
        )
