"""Who it is, from landmarks and images together: shape, albedo and light (Lips16 3.2).

Minimises, over identity, landmark offsets, unknown focal lengths and the poses and weights of a
few frames of all takes, the energy of the landmarks (`tracking.identity`) and, with a light and an
albedo for each take,

    strength * mean over visible samples of rho(|display(image) - display(albedo * SH(normal))|)
    + how far the albedo is from the skin's one colour

The albedo of each sample is eliminated: held, it would hold the shape that it was estimated under.
Light, visibility and the images' resolution are held for a round of steps, then found again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.appearance.estimate import (
    SampleObservations,
    estimate_appearance,
    fit_albedo,
    median_colour,
)
from vermilion.appearance.harmonics import harmonics_jacobian, irradiance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.appearance.samples import sample_skin
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.imaging.display import display_slope, to_display_values
from vermilion.tracking.identity.landmark_identity import IdentityFit, IdentityProblem
from vermilion.tracking.image_fit.frame_fit import visible_trust
from vermilion.tracking.image_fit.image_levels import PyramidLevel, image_pyramid
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.gauss_newton import active_bounds, gauss_newton
from vermilion.tracking.landmark_fit.observation import project, projection_jacobian
from vermilion.tracking.landmark_fit.pose import cross_matrix, left_jacobian, rotation_of
from vermilion.tracking.landmark_fit.shape import (
    landmark_identities,
    landmark_neutral,
    uniform_scale_share,
)


@dataclass(frozen=True)
class IdentityImageSettings:
    """How much the images count.

    Attributes:
        spacing_mm: between samples of the skin.
        pixel_mm: of the images that are compared.
        sigma: deviation of a colour, display values (0 to 255).
        robust_sigmas: a sample this many deviations off counts half (Cauchy).
        strength: how many independent samples a face is worth.
        albedo_prior: how many frames' worth the skin's one colour counts at each sample.
        rounds: of `iterations` Gauss-Newton steps each.
    """

    spacing_mm: float = 5.0
    pixel_mm: float = 8.0
    sigma: float = 6.0
    robust_sigmas: float = 2.0
    strength: float = 10.0
    albedo_prior: float = 0.5
    rounds: int = 3
    iterations: int = 4


@dataclass(frozen=True)
class JointFit:
    """The person, and what the images show of them before and after.

    Attributes:
        person: identity, landmark offsets, focal lengths.
        sheet: a frame each, of the state from landmarks alone and of the joint one: [(errors
            (N, 3) in display values, trust (N,), place (N, 2) in pixels from the principal point)].
    """

    person: IdentityFit
    sheet: list[list[tuple[np.ndarray, np.ndarray, np.ndarray]]]


@dataclass(frozen=True)
class _Look:
    """What one frame shows at the samples, and from where the model is seen."""

    colours: np.ndarray  # (N, 3) linear
    slopes: np.ndarray  # (N, 3, 2) a pixel
    trust: np.ndarray  # (N,)
    normals: np.ndarray  # (N, 3) camera frame
    rotation: np.ndarray  # (3, 3) camera from head
    turned: np.ndarray  # (N, 3) camera frame, before the translation
    points: np.ndarray  # (N, 3) camera frame
    image: np.ndarray  # (N, 2)


@dataclass(frozen=True)
class _Colours:
    """A take's frames as they are and as they are predicted, the albedo being the best."""

    errors: np.ndarray  # (M, N, 3) display values
    weights: np.ndarray  # (M, N) of the squared errors, without the robust share
    by_albedo: np.ndarray  # (M, N, 3) derivative of the prediction by the albedo
    predicted: np.ndarray  # (M, N, 3) linear
    albedo: np.ndarray  # (N, 3)
    skin: np.ndarray  # (3,)
    prior: np.ndarray  # (N, 3) of the squared albedo less skin


def fit_joint_identity(
    model: FaceModel,
    problem: IdentityProblem,
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    settings: IdentityImageSettings,
) -> JointFit:
    """One person from frames of their takes.

    Args:
        problem: the landmarks of F frames.
        images: F of (h, w, 3) linear RGB; cameras: theirs.
    """
    frames, shared = problem.solve()
    looks = []
    samples = sample_skin(model, settings.spacing_mm)
    for turn in range(settings.rounds):
        held = _Round(model, problem, samples, images, cameras, settings, frames, shared)
        if turn == 0:
            looks.append(held.residuals(frames, shared))
        frames, shared = gauss_newton(held, frames, shared, settings.iterations)
    looks.append(held.residuals(frames, shared))
    return JointFit(
        problem.result(frames, shared), [list(pair) for pair in zip(*looks, strict=True)]
    )


class _Round:
    """The energy with light, visibility and resolution as one state has them."""

    def __init__(self, model, problem, samples, images, cameras, settings, frames, shared):
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
            rotation = rotation_of(row[:3]) @ problem.reference
            weights = self._weights(row, shared)
            points = self.face.points(weights) @ rotation.T + row[3:6]
            normals = self.face.normals(weights) @ rotation.T
            shape = neutral + np.tensordot(row[N_POSE:], model.expressions_mm, axes=1)
            mesh = shape @ rotation.T + row[3:6]
            self.trust[index] = visible_trust(model, mesh, points, normals)
            self.levels += image_pyramid(image, cameras[index], points, settings.pixel_mm, 1)
        self.lights = [self._light(rows, frames, shared) for rows in self.takes]

    def _weights(self, row: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """Of the face's shapes: blend weights (K,), then identity less where the round began (I,)."""
        return np.concatenate([row[N_POSE:], shared[: self.n_identity] - self.centre])

    def _look(self, index: int, frames: np.ndarray, shared: np.ndarray) -> _Look:
        row, weights = frames[index], self._weights(frames[index], shared)
        rotation = rotation_of(row[:3]) @ self.problem.reference
        turned = self.face.points(weights) @ rotation.T
        points = turned + row[3:6]
        image = project(points, self.problem.focal(shared)[index])
        colours, slopes, inside = self.levels[index].sample(image)
        normals = self.face.normals(weights) @ rotation.T
        trust = self.trust[index] * inside
        return _Look(colours, slopes, trust, normals, rotation, turned, points, image)

    def _light(self, rows, frames, shared) -> np.ndarray:
        looks = [self._look(index, frames, shared) for index in rows]
        seen = SampleObservations(
            np.stack([look.colours for look in looks])[:, None],
            np.stack([look.normals for look in looks]),
            np.stack([look.trust for look in looks]),
        )
        prior = self.settings.albedo_prior
        return estimate_appearance(rows, self.samples, seen, prior).light

    def _colours(self, looks: list[_Look], light: np.ndarray) -> _Colours:
        s = self.settings
        colours = np.stack([look.colours for look in looks])
        trust = np.stack([look.trust for look in looks])
        shading = irradiance(np.stack([look.normals for look in looks]), light)
        skin = median_colour(colours / shading, trust)
        albedo = fit_albedo(colours, shading, trust, skin, s.albedo_prior)
        predicted = albedo * shading
        errors = to_display_values(colours) - to_display_values(predicted)
        unit = s.strength / (3 * s.sigma**2) / np.maximum(trust.sum(axis=1, keepdims=True), 1e-9)
        mean = shading.mean(axis=0)
        prior = s.albedo_prior * unit.mean() * (display_slope(albedo * mean) * mean) ** 2
        prior = np.where(trust.any(axis=0)[:, None], prior, 0.0)
        by_albedo = display_slope(predicted) * shading
        return _Colours(errors, unit * trust, by_albedo, predicted, albedo, skin, prior)

    def cost(self, frames: np.ndarray, shared: np.ndarray) -> float:
        """The energy; infinite where a landmark is behind the camera."""
        total = self.problem.cost(frames, shared)
        if not np.isfinite(total):
            return total
        limit = 3 * (self.settings.sigma * self.settings.robust_sigmas) ** 2
        for rows, light in zip(self.takes, self.lights, strict=True):
            found = self._colours([self._look(i, frames, shared) for i in rows], light)
            squared = (found.errors**2).sum(axis=2)
            total += 0.5 * limit * (found.weights * np.log1p(squared / limit)).sum()
            total += 0.5 * (found.prior * (found.albedo - found.skin) ** 2).sum()
        return float(total)

    def newton_step(self, frames: np.ndarray, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gauss-Newton step with the weights that press against their bounds held."""
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
        for take, (rows, light) in enumerate(zip(self.takes, self.lights, strict=True)):
            self._add_images(matrix, gradient, take, rows, light, frames, shared)
        held = active_bounds(frames, gradient[:first].reshape(frames.shape))
        free = np.concatenate([~held.ravel(), np.ones(len(shared), dtype=bool)])
        system = matrix[np.ix_(free, free)]
        system[np.diag_indices_from(system)] *= 1 + 1e-3  # what nothing tells stays put
        step = np.zeros(total)
        step[free] = -np.linalg.solve(system, gradient[free])
        return step[:first].reshape(frames.shape), step[first:]

    def _add_images(self, matrix, gradient, take, rows, light, frames, shared):
        """Adds the images of a take to the system (P, P) and its gradient (P,)."""
        looks = [self._look(index, frames, shared) for index in rows]
        found = self._colours(looks, light)
        limit = 3 * (self.settings.sigma * self.settings.robust_sigmas) ** 2
        weights = found.weights / (1 + (found.errors**2).sum(axis=2) / limit)
        size, first = frames.shape[1], frames.size
        # Columns of the shared unknowns that images tell of: identity, and the take's focal length.
        focal = first + len(shared) - len(self.problem.guess) + self.problem.take[rows[0]]
        common = np.append(np.arange(first, first + self.n_identity), focal)
        curvature = (weights[..., None] * found.by_albedo**2).sum(axis=0) + found.prior
        root = np.sqrt(np.maximum(curvature, 1e-12)).reshape(-1)
        # The albedo is at its best: what is left of its gradient is nought but for rounding and
        # the robust weights.
        left = -(found.prior * (found.albedo - found.skin)).reshape(-1)
        through = np.zeros((curvature.size, len(rows) * size + len(common)), dtype=np.float32)
        columns = [np.arange(index * size, (index + 1) * size) for index in rows] + [common]
        for place, (index, look) in enumerate(zip(rows, looks, strict=True)):
            jacobian = self._jacobian(index, frames, shared, look, found, place, light)
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

    def _jacobian(self, index, frames, shared, look, found, place, light) -> np.ndarray:
        """Derivative (3 N, 6 + K + I + 1) of a frame's errors by its unknowns, identity and log focal."""
        row, focal = frames[index], self.problem.focal(shared)[index]
        turn = left_jacobian(row[:3])
        seen = display_slope(look.colours)[..., None] * look.slopes
        by_point = seen @ projection_jacobian(look.points, focal)
        by_rotation = by_point @ (-cross_matrix(look.turned) @ turn)
        by_shape = (by_point @ look.rotation).astype(np.float32) @ self.face.expressions_mm
        lit = np.tensordot(harmonics_jacobian(look.normals), light, axes=([1], [0]))
        by_normal = found.albedo * display_slope(found.predicted[place])
        by_normal = by_normal[..., None] * np.swapaxes(lit, 1, 2)
        by_rotation -= by_normal @ (-cross_matrix(look.normals) @ turn)
        weights = self._weights(row, shared)
        by_shape -= self.face.through_normals(weights, by_normal @ look.rotation)
        by_focal = (seen @ look.image[..., None]).astype(np.float32)
        parts = [by_rotation, by_point, by_shape, by_focal]
        joined = np.concatenate([part.astype(np.float32) for part in parts], axis=2)
        return joined.reshape(-1, joined.shape[2])

    def residuals(self, frames: np.ndarray, shared: np.ndarray) -> list[tuple]:
        """(errors (N, 3), trust (N,), place (N, 2)) of every frame, as in `JointFit.sheet`."""
        results = {}
        for rows, light in zip(self.takes, self.lights, strict=True):
            looks = [self._look(index, frames, shared) for index in rows]
            errors = self._colours(looks, light).errors
            for index, look, error in zip(rows, looks, errors, strict=True):
                results[int(index)] = (error, look.trust, look.image)
        return [results[index] for index in range(len(frames))]


def _scale_free_identities(model: FaceModel) -> np.ndarray:
    """Identities (I, V, 3) less what they change of the landmarks' size, as the landmarks' energy."""
    landmarks = landmark_neutral(model)
    share = uniform_scale_share(landmark_identities(model), landmarks)
    about = model.neutral_mm - landmarks.mean(axis=0)
    return model.identities_mm - share[:, None, None] * about
