"""Pose and expression of one frame from its image (Lips16 3.2): Gauss-Newton, coarse to fine.

Minimises, over the rotation, the translation and the weights w in [0, 1],

    strength * mean over visible samples of rho(|display(image) - display(albedo * SH(normal))|)
    + the landmark terms and |w|^2 / weight_sigma^2 of the landmark fit
    + |x - x_landmarks|^2 over the squared typical change from the landmark fit

The model's colours are multiplied by the frame's gain: a camera may change its exposure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.appearance.harmonics import harmonics_jacobian, irradiance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.faces.model import FaceModel
from vermilion.geometry.raycast import RayCaster
from vermilion.geometry.rotations import cross_matrix, left_jacobian, rotation_matrix
from vermilion.imaging.display import display_slope, to_display_values
from vermilion.tracking.image_fit.image_levels import PyramidLevel
from vermilion.tracking.image_fit.landmark_term import LandmarkTerm
from vermilion.tracking.landmark_fit.banded_qp import FrameMatrix, solve_in_box
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.observation import project, projection_jacobian

#: Logarithm of the largest change of exposure that is believed.
_LARGEST_GAIN = 1.5


@dataclass(frozen=True)
class FrameFitSettings:
    """How much the image counts beside the landmarks.

    Attributes:
        sigma: deviation of a colour, display values (0 to 255).
        robust_sigmas: a sample this many deviations off counts half (Cauchy).
        strength: weight of the whole face's image, in independent samples.
        rotation_deg, translation_mm, depth_mm, weight: typical change from the landmark fit.
        iterations: Gauss-Newton steps at each resolution, coarsest first.
        shading: whether the Jacobian has the change of shading with the normal, besides the motion.
    """

    sigma: float = 6.0
    robust_sigmas: float = 2.0
    strength: float = 4000.0
    rotation_deg: float = 3.0
    translation_mm: float = 5.0
    depth_mm: float = 10.0
    weight: float = 0.2
    iterations: Sequence[int] = (3, 3, 4)
    shading: bool = False


@dataclass(frozen=True)
class FrameView:
    """The data of one frame.

    Attributes:
        levels: image pyramid, finest first.
        focal_px: of the ideal pinhole camera.
        trust: (N,) in [0, 1] of each sample in this frame; zero where hidden.
        landmarks: the frame's landmark term.
        start: (6 + K,) the landmark fit: rotation vector, translation, weights.
        reference: (3, 3) rotation that the rotation vector is relative to.
    """

    levels: list[PyramidLevel]
    focal_px: float
    trust: np.ndarray
    landmarks: LandmarkTerm
    start: np.ndarray
    reference: np.ndarray


@dataclass(frozen=True)
class FrameFit:
    """A frame's solution and the quadratic model of the energy there, x'Ax/2 - b'x.

    Attributes:
        x: (6 + K,) rotation vector, translation, weights.
        matrix: (6 + K, 6 + K) A.
        right: (6 + K,) b.
        gain: brightness of the frame over that of the appearance.
    """

    x: np.ndarray
    matrix: np.ndarray
    right: np.ndarray
    gain: float


@dataclass(frozen=True)
class _VisibleSamples:
    """The n samples that one frame shows: face, albedo (L, n, 3) times the frame's gain, trust (n,)."""

    face: SampledFace
    albedo: np.ndarray
    trust: np.ndarray
    gain: float


class FrameProblem:
    """The energy above, of one person with one appearance."""

    def __init__(
        self,
        face: SampledFace,
        appearance: Appearance,
        settings: FrameFitSettings,
        weight_sigma: float | np.ndarray,
    ):
        """`weight_sigma` is the deviation of the blend weights about zero: one, or (K,)."""
        self.face, self.appearance, self.settings = face, appearance, settings
        n_weights = face.expressions_mm.shape[2]
        self.weight_prior = np.zeros(N_POSE + n_weights)
        self.weight_prior[N_POSE:] = np.asarray(weight_sigma, dtype=float) ** -2.0
        s = settings
        typical = np.full(N_POSE + n_weights, s.weight)
        typical[:3], typical[3:5], typical[5] = (
            np.radians(s.rotation_deg),
            s.translation_mm,
            s.depth_mm,
        )
        self.stay = typical**-2.0
        self.lower = np.full(N_POSE + n_weights, -np.inf)
        self.upper = -self.lower
        self.lower[N_POSE:], self.upper[N_POSE:] = 0.0, 1.0

    def solve(self, view: FrameView) -> FrameFit:
        """The frame's solution, coarse to fine from the landmark fit."""
        x, counts = view.start, self.settings.iterations
        for level, count in zip(reversed(range(len(counts))), counts, strict=True):
            x, part, errors = self._descended(x, view, level, count)
        matrix, right = self._normal_equations(x, view, 0, part, errors)
        return FrameFit(x, matrix, right, part.gain)

    def settled(self, view: FrameView, x: np.ndarray) -> tuple[np.ndarray, float]:
        """A better x (6 + K,) at the finest resolution, beginning at `x` (6 + K,), and the frame's gain.

        Half of the steps: who calls it again, with the next appearance, need not converge each time.
        """
        x, part, _ = self._descended(x, view, 0, (self.settings.iterations[-1] + 1) // 2)
        return x, part.gain

    def _descended(
        self, x: np.ndarray, view: FrameView, level: int, count: int
    ) -> tuple[np.ndarray, _VisibleSamples, tuple]:
        """At most `count` Gauss-Newton steps from x (6 + K,) at one resolution."""
        # Coarse images need fewer samples.
        part = self._exposed(self._visible(view, 2**level), x, view, level)
        cost, errors = self._cost(x, view, level, part)
        for _ in range(count):
            matrix, right = self._normal_equations(x, view, level, part, errors)
            program = FrameMatrix(matrix)
            target = solve_in_box(program, right[None], self.lower, self.upper, x[None])[0]
            for scale in (1.0, 0.5, 0.25):
                trial = x + scale * (target - x)
                trial_cost, trial_errors = self._cost(trial, view, level, part)
                if trial_cost < cost:
                    break
            else:
                break
            x, cost, errors = trial, trial_cost, trial_errors
        return x, part, errors

    def _exposed(self, part: _VisibleSamples, x, view: FrameView, level: int) -> _VisibleSamples:
        """The samples with the gain that explains the frame's brightness at x (6 + K,)."""
        _, parts, weight = self._errors(x, view, level, part)
        gain = exposure_gain(parts[-2], parts[-1], weight)
        return replace(part, albedo=part.albedo * gain, gain=gain)

    def _visible(self, view: FrameView, every: int) -> _VisibleSamples:
        rows = np.flatnonzero((view.trust > 0) & (self.appearance.seen > 0))[::every]
        albedo = self.appearance.albedo[:, rows]
        return _VisibleSamples(self.face[rows], albedo, view.trust[rows], 1.0)

    def _errors(self, x, view, level, part):
        """Image minus model (n, 3) display values, its intermediate results, and trust (n,)."""
        rotation = rotation_matrix(x[:3]) @ view.reference
        turned = part.face.points(x[N_POSE:]) @ rotation.T
        points = turned + x[3:6]
        normals = part.face.normals(x[N_POSE:]) @ rotation.T
        found, slopes, inside = view.levels[level].sample(project(points, view.focal_px))
        predicted = part.albedo[level] * irradiance(normals, self.appearance.light)
        error = to_display_values(found) - to_display_values(predicted)
        seen = display_slope(found)[..., None] * slopes
        parts = (rotation, turned, points, normals, seen, found, predicted)
        return error, parts, part.trust * inside

    def _cost(self, x, view, level, part) -> tuple[float, tuple]:
        """The energy at x, and the errors that it is of."""
        errors = self._errors(x, view, level, part)
        error, _, weight = errors
        s = self.settings
        squared = (error**2).sum(axis=1) / (3 * s.sigma**2 * s.robust_sigmas**2)
        rho = 0.5 * s.robust_sigmas**2 * np.log1p(squared)
        total = s.strength * (weight * rho).sum() / max(weight.sum(), 1e-9)
        total += view.landmarks.cost(x, view.reference)
        total += 0.5 * (self.weight_prior * x**2).sum()
        return float(total + 0.5 * (self.stay * (x - view.start) ** 2).sum()), errors

    def _normal_equations(self, x, view, level, part, errors):
        """A (6 + K, 6 + K) and b (6 + K,) of the energy's quadratic model x'Ax/2 - b'x at x."""
        error, parts, weight = errors
        s = self.settings
        robust = 1.0 / (1.0 + (error**2).sum(axis=1) / (3 * s.sigma**2 * s.robust_sigmas**2))
        scale = s.strength / (3 * s.sigma**2) * weight * robust / max(weight.sum(), 1e-9)
        root = np.sqrt(scale).astype(np.float32)
        jacobian = self._jacobian(x, view, level, part, parts) * root[:, None, None]
        rows = jacobian.reshape(-1, jacobian.shape[-1])
        values = (error * root[:, None]).astype(np.float32).reshape(-1)
        matrix, gradient = view.landmarks.normal_equations(x, view.reference)
        matrix = matrix + (rows.T @ rows).astype(np.float64)
        gradient = gradient + (rows.T @ values).astype(np.float64)
        right = matrix @ x - gradient + self.stay * view.start
        diagonal = np.arange(len(x))
        matrix[diagonal, diagonal] += self.stay + self.weight_prior
        return matrix, right

    def _jacobian(self, x, view, level, part, parts) -> np.ndarray:
        """Derivative (n, 3, 6 + K) float32 of the errors."""
        rotation, turned, points, normals, seen, _, predicted = parts
        turn = left_jacobian(x[:3])
        by_point = seen @ projection_jacobian(points, view.focal_px)
        by_rotation = by_point @ (-cross_matrix(turned) @ turn)
        by_weight = (by_point @ rotation).astype(np.float32) @ part.face.expressions_mm
        if self.settings.shading:
            albedo = part.albedo[level] * display_slope(predicted)
            by_normal = np.tensordot(
                harmonics_jacobian(normals), self.appearance.light, axes=([1], [0])
            )
            by_normal = albedo[..., None] * np.swapaxes(by_normal, 1, 2)
            by_rotation -= by_normal @ (-cross_matrix(normals) @ turn)
            by_weight -= part.face.through_normals(x[N_POSE:], by_normal @ rotation)
        return np.concatenate(
            [by_rotation.astype(np.float32), by_point.astype(np.float32), by_weight], axis=2
        )


def exposure_gain(found: np.ndarray, predicted: np.ndarray, trust: np.ndarray) -> float:
    """By how much an image is brighter than the model: the median over the seen samples.

    Args:
        found, predicted: (n, 3) linear RGB of the image and of the model.
        trust: (n,) in [0, 1].
    """
    light, model = found.sum(axis=1), predicted.sum(axis=1)
    use = np.flatnonzero((trust > 0) & (light > 0) & (model > 0))
    if not len(use):
        return 1.0
    ratio = np.log(light[use] / model[use])
    order = np.argsort(ratio, kind="stable")
    share = np.cumsum(trust[use][order])
    middle = ratio[order][np.searchsorted(share, 0.5 * share[-1])]
    return float(np.exp(np.clip(middle, -_LARGEST_GAIN, _LARGEST_GAIN)))


def visible_trust(
    model: FaceModel,
    vertices_mm: np.ndarray,
    points_mm: np.ndarray,
    normals: np.ndarray,
    least_cosine: float = 0.25,
) -> np.ndarray:
    """Trust (N,) of samples in [0, 1]: 1 seen frontally, 0 hidden or oblique.

    Args:
        model: topology of the mesh.
        vertices_mm: (V, 3) mesh, camera frame.
        points_mm: (N, 3) samples, camera frame.
        normals: (N, 3) unit normals of the samples, camera frame.
        least_cosine: cosine of normal and viewing direction at which trust becomes zero.
    """
    distance = np.linalg.norm(points_mm, axis=1)
    rays = points_mm / distance[:, None]
    cosine = -(normals * rays).sum(axis=1)
    trust = np.clip((cosine - least_cosine) / (1 - least_cosine), 0.0, 1.0)
    facing = np.flatnonzero(trust > 0)
    hits = RayCaster(vertices_mm, model.triangles).cast(np.zeros(3), rays[facing])
    trust[facing[hits.distance_mm < distance[facing] - 1.0]] = 0.0
    return trust
