"""The person from landmarks and images together: shape, albedo and light (Lips16 3.2).

The unknowns are identity, landmark offsets, unknown focal lengths, and the poses and weights of a
few frames of all takes. The energy is that of the landmarks (`landmark_identity`) and, with a light
and an albedo for each take,

    strength * mean over visible samples of rho(|display(image) - display(albedo * SH(normal))|)
    + squared difference of the albedo and the skin's median colour

The albedo is eliminated (`colour_residuals`). Light, visibility and the images' resolution are fixed
for a round of Gauss-Newton steps, then estimated again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import SupportsIndex

import numpy as np

from vermilion.appearance.estimate import SampleObservations, estimate_appearance
from vermilion.appearance.harmonics import harmonics_jacobian
from vermilion.appearance.sampled_face import SampledFace
from vermilion.appearance.samples import sample_skin
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.rotations import cross_matrix, left_jacobian, rotation_matrix
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.imaging.display import display_slope
from vermilion.tracking.identity.colour_residuals import (
    IdentityImageSettings,
    SampledFrame,
    colour_residuals,
)
from vermilion.tracking.identity.landmark_identity import IdentityFit, IdentityProblem
from vermilion.tracking.image_fit.frame_fit import visible_trust
from vermilion.tracking.image_fit.image_levels import PyramidLevel, image_pyramid
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.gauss_newton import active_bounds, gauss_newton
from vermilion.tracking.landmark_fit.observation import project, projection_jacobian
from vermilion.tracking.landmark_fit.shape import (
    landmark_identities,
    landmark_neutral,
    uniform_scale_share,
)


@dataclass(frozen=True)
class JointFit:
    """The person, and the errors of the images before and after.

    Attributes:
        person: identity, landmark offsets, focal lengths.
        residuals: for each frame, of the state from landmarks alone and of the joint one: (errors
            (N, 3) in display values, trust (N,), place (N, 2) in pixels from the principal point).
    """

    person: IdentityFit
    residuals: list[list[tuple[np.ndarray, np.ndarray, np.ndarray]]]


def fit_joint_identity(
    model: FaceModel,
    problem: IdentityProblem,
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    settings: IdentityImageSettings,
) -> JointFit:
    """Fit one person to frames of their takes.

    Args:
        model: the face model.
        problem: the landmarks of F frames.
        images: F images (h, w, 3), linear RGB.
        cameras: the camera of each image.
        settings: weight of the images.
    """
    frames, shared = problem.solve()
    residuals = []
    samples = sample_skin(model, settings.spacing_mm)
    for turn in range(settings.rounds):
        joint = _JointProblem(model, problem, samples, images, cameras, settings, frames, shared)
        if turn == 0:
            residuals.append(joint.residuals(frames, shared))
        frames, shared = gauss_newton(joint, frames, shared, settings.iterations)
    residuals.append(joint.residuals(frames, shared))
    return JointFit(
        problem.result(frames, shared), [list(pair) for pair in zip(*residuals, strict=True)]
    )


class _JointProblem:
    """The energy (a `GaussNewtonProblem`) with light, visibility and resolution of one state.

    Args:
        model, problem, samples, settings: the face, the landmark energy, skin samples, weights.
        images: linear RGB of the F frames, each `images[f]` (h, w, 3).
        cameras: of the images.
        frames: (F, 6 + K) pose and weights of the state.
        shared: (S,) identity, landmark offsets and log focal lengths of the state.
    """

    def __init__(
        self,
        model: FaceModel,
        problem: IdentityProblem,
        samples: SurfacePoints,
        images: Sequence[np.ndarray],
        cameras: Sequence[Camera],
        settings: IdentityImageSettings,
        frames: np.ndarray,
        shared: np.ndarray,
    ):
        self.problem, self.samples, self.settings = problem, samples, settings
        self.n_identity = problem.n_identity
        self.centre = shared[: self.n_identity].copy()
        self.takes = [np.flatnonzero(problem.take == take) for take in np.unique(problem.take)]
        identities = _scale_free_identities(model)
        neutral = model.neutral_mm + np.tensordot(self.centre, identities, axes=1)
        shapes = np.concatenate([model.expressions_mm, identities.astype(np.float32)])
        self.face = SampledFace.of(model, neutral, samples, shapes)
        self.levels: list[PyramidLevel] = []
        self.trust = np.zeros((len(frames), len(samples)))
        for index, (row, image) in enumerate(zip(frames, images, strict=True)):
            rotation = rotation_matrix(row[:3]) @ problem.reference
            weights = self._weights(row, shared)
            points = self.face.points(weights) @ rotation.T + row[3:6]
            normals = self.face.normals(weights) @ rotation.T
            shape = neutral + np.tensordot(row[N_POSE:], model.expressions_mm, axes=1)
            mesh = shape @ rotation.T + row[3:6]
            self.trust[index] = visible_trust(model, mesh, points, normals)
            self.levels += image_pyramid(image, cameras[index], points, settings.pixel_mm, 1)
        self.lights = [self._light(rows, frames, shared) for rows in self.takes]

    def _weights(self, row: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """Weights of the face's shapes: blend weights (K,), then the change of identity (I,)."""
        return np.concatenate([row[N_POSE:], shared[: self.n_identity] - self.centre])

    def _sampled(
        self, index: SupportsIndex, frames: np.ndarray, shared: np.ndarray
    ) -> SampledFrame:
        row, weights = frames[index], self._weights(frames[index], shared)
        rotation = rotation_matrix(row[:3]) @ self.problem.reference
        turned = self.face.points(weights) @ rotation.T
        points = turned + row[3:6]
        image = project(points, self.problem.focal(shared)[index])
        colours, slopes, inside = self.levels[index].sample(image)
        normals = self.face.normals(weights) @ rotation.T
        trust = self.trust[index] * inside
        return SampledFrame(colours, slopes, trust, normals, rotation, turned, points, image)

    def _light(self, rows: np.ndarray, frames: np.ndarray, shared: np.ndarray) -> np.ndarray:
        sampled = [self._sampled(index, frames, shared) for index in rows]
        seen = SampleObservations(
            np.stack([frame.colours for frame in sampled])[:, None],
            np.stack([frame.normals for frame in sampled]),
            np.stack([frame.trust for frame in sampled]),
        )
        prior = self.settings.albedo_prior
        return estimate_appearance(rows, self.samples, seen, prior).light

    def cost(self, frames: np.ndarray, shared: np.ndarray) -> float:
        """Energy of `frames` (F, 6 + K) and `shared` (S,); infinite behind the camera."""
        total = self.problem.cost(frames, shared)
        if not np.isfinite(total):
            return total
        limit = 3 * (self.settings.sigma * self.settings.robust_sigmas) ** 2
        for rows, light in zip(self.takes, self.lights, strict=True):
            found = colour_residuals(
                [self._sampled(i, frames, shared) for i in rows], light, self.settings
            )
            squared = (found.errors**2).sum(axis=2)
            total += 0.5 * limit * (found.weights * np.log1p(squared / limit)).sum()
            total += 0.5 * (found.prior * (found.albedo - found.skin) ** 2).sum()
        return float(total)

    def newton_step(self, frames: np.ndarray, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step of `frames` (F, 6 + K) and of `shared` (S,); weights at active bounds stay."""
        known = self.problem.normal_equations(frames, shared)
        n_frames, size = frames.shape
        first, total = n_frames * size, n_frames * size + len(shared)
        matrix, gradient = np.zeros((total, total)), np.zeros(total)
        for index in range(n_frames):
            own = slice(index * size, (index + 1) * size)
            matrix[own, own] = known.blocks[index]
            matrix[own, first:] = known.coupling[index]
            matrix[first:, own] = known.coupling[index].T
        matrix[first:, first:] = known.system
        gradient[:first], gradient[first:] = known.frame_gradient.ravel(), known.shared_gradient
        for rows, light in zip(self.takes, self.lights, strict=True):
            self._add_images(matrix, gradient, rows, light, frames, shared)
        fixed = active_bounds(frames, gradient[:first].reshape(frames.shape))
        free = np.concatenate([~fixed.ravel(), np.ones(len(shared), dtype=bool)])
        system = matrix[np.ix_(free, free)]
        system[np.diag_indices_from(system)] *= 1 + 1e-3  # unknowns without data stay
        step = np.zeros(total)
        step[free] = -np.linalg.solve(system, gradient[free])
        return step[:first].reshape(frames.shape), step[first:]

    def _add_images(self, matrix, gradient, rows, light, frames, shared):
        """Add the images of a take to the system (P, P) and its gradient (P,), in place."""
        sampled = [self._sampled(index, frames, shared) for index in rows]
        found = colour_residuals(sampled, light, self.settings)
        limit = 3 * (self.settings.sigma * self.settings.robust_sigmas) ** 2
        weights = found.weights / (1 + (found.errors**2).sum(axis=2) / limit)
        size, first = frames.shape[1], frames.size
        # Columns of the shared unknowns that images depend on: identity, the take's focal length.
        focal = first + len(shared) - len(self.problem.guess) + self.problem.take[rows[0]]
        common = np.append(np.arange(first, first + self.n_identity), focal)
        curvature = (weights[..., None] * found.by_albedo**2).sum(axis=0) + found.prior
        root = np.sqrt(np.maximum(curvature, 1e-12)).reshape(-1)
        # The albedo is optimal: its gradient is zero except for rounding and the robust weights.
        left = -(found.prior * (found.albedo - found.skin)).reshape(-1)
        through = np.zeros((curvature.size, len(rows) * size + len(common)), dtype=np.float32)
        columns = [np.arange(index * size, (index + 1) * size) for index in rows] + [common]
        for place, (index, frame) in enumerate(zip(rows, sampled, strict=True)):
            jacobian = self._jacobian(index, frames, shared, frame, found, place, light)
            error = found.errors[place].reshape(-1)
            weight = np.repeat(weights[place], 3)
            own = np.concatenate([columns[place], common])
            scaled = jacobian * np.sqrt(weight).astype(np.float32)[:, None]
            matrix[np.ix_(own, own)] += scaled.T @ scaled
            gradient[own] += scaled.T @ (error * np.sqrt(weight)).astype(np.float32)
            by_albedo = weight * found.by_albedo[place].reshape(-1)
            share = jacobian * (by_albedo / root).astype(np.float32)[:, None]
            through[:, place * size : (place + 1) * size] = share[:, :size]
            through[:, len(rows) * size :] += share[:, size:]
            left += by_albedo * error
        every = np.concatenate(columns)
        matrix[np.ix_(every, every)] -= through.T @ through
        gradient[every] -= through.T @ (left / root).astype(np.float32)

    def _jacobian(self, index, frames, shared, frame, found, place, light) -> np.ndarray:
        """Derivative (3 N, 6 + K + I + 1) of a frame's errors: its unknowns, identity, log focal."""
        row, focal = frames[index], self.problem.focal(shared)[index]
        turn = left_jacobian(row[:3])
        seen = display_slope(frame.colours)[..., None] * frame.slopes
        by_point = seen @ projection_jacobian(frame.points, focal)
        by_rotation = by_point @ (-cross_matrix(frame.turned) @ turn)
        by_shape = (by_point @ frame.rotation).astype(np.float32) @ self.face.expressions_mm
        lit = np.tensordot(harmonics_jacobian(frame.normals), light, axes=([1], [0]))
        by_normal = found.albedo * display_slope(found.predicted[place])
        by_normal = by_normal[..., None] * np.swapaxes(lit, 1, 2)
        by_rotation -= by_normal @ (-cross_matrix(frame.normals) @ turn)
        weights = self._weights(row, shared)
        by_shape -= self.face.through_normals(weights, by_normal @ frame.rotation)
        by_focal = (seen @ frame.image[..., None]).astype(np.float32)
        parts = [by_rotation, by_point, by_shape, by_focal]
        joined = np.concatenate([part.astype(np.float32) for part in parts], axis=2)
        return joined.reshape(-1, joined.shape[2])

    def residuals(self, frames: np.ndarray, shared: np.ndarray) -> list[tuple]:
        """`JointFit.residuals` of every frame at `frames` (F, 6 + K) and `shared` (S,)."""
        results: dict[int, tuple] = {}
        for rows, light in zip(self.takes, self.lights, strict=True):
            sampled = [self._sampled(index, frames, shared) for index in rows]
            errors = colour_residuals(sampled, light, self.settings).errors
            for index, frame, error in zip(rows, sampled, errors, strict=True):
                results[int(index)] = (error, frame.trust, frame.image)
        return [results[index] for index in range(len(frames))]


def _scale_free_identities(model: FaceModel) -> np.ndarray:
    """Identities (I, V, 3) without uniform scale of the landmarks, as in the landmarks' energy."""
    landmarks = landmark_neutral(model)
    share = uniform_scale_share(landmark_identities(model), landmarks)
    about = model.neutral_mm - landmarks.mean(axis=0)
    return model.identities_mm - share[:, None, None] * about
