"""Sketched frames of a new actor together with a prior of other actors' lips (`LipPrior`).

A contour in one image says nothing of depth and roll; how other actors' lips move says which of the
meshes on the stroke's rays is likely, and how a frame's correction goes over to the others. All
sketched frames are solved at once: unknowns are the coefficients c_f of the prior's modes, r a frame,
and the observations the rays of the strokes, linear in c about the contours of the mesh as it is now:

    minimise  sum over strokes of  (J c - r)^T N^-1 (J c - r)  +  (c - m)^T K^-1 (c - m),

with m, K of the prior and N a hand's error, alike along a stroke. Contours are found anew in each
round. Frames without a sketch follow as the conditional mean of the same Gaussian.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.correction.constraints import LinearConstraints
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.camera import Camera
from vermilion.guided.lip_prior import LipPrior
from vermilion.guided.refinement import RefinementSettings, SketchView, ray_constraints
from vermilion.guided.silhouette import ContourSurface
from vermilion.guided.sketch import Sketch
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class HandNoise:
    """How strokes differ from contours.

    Attributes:
        hand_px: deviation of a hand, about the same over `alike` of a stroke's length.
        alike: share of a stroke.
        detail_mm: what the modes cannot show, independent point by point.
        pose_mm: deviation of the base's place in the world, the same in all strokes of a frame.
        depth_mm: the same along the view of a frame's first camera, by which the base was tracked.
    """

    hand_px: float = 1.0
    alike: float = 0.2
    detail_mm: float = 0.25
    pose_mm: float = 0.2
    depth_mm: float = 2.0


@dataclass(frozen=True)
class PriorSolution:
    """What the strokes and the prior say of a sequence.

    Attributes:
        coefficients: (F, r) of all frames.
        sketched: (k,) rows of the frames that were drawn.
        deviation: (F,) how uncertain a frame still is: RMS over the modes, mm.
    """

    coefficients: np.ndarray
    sketched: np.ndarray
    deviation: np.ndarray


class PriorRefiner:
    """Solves sketched frames of one person with a prior, and predicts the others.

    Attributes:
        prior: of other actors.
        stable: (s,) vertices that hold the head.
    """

    def __init__(
        self,
        neutral_mm: np.ndarray,
        prior: LipPrior,
        surface: ContourSurface,
        stable: np.ndarray,
        noise: HandNoise | None = None,
        rounds: int = 4,
    ):
        """Prepare a person.

        Args:
            neutral_mm: (V, 3), head frame.
            prior: of the topology.
            surface: where contours are looked for.
            stable: (s,) vertex ids for the head's pose.
            noise: of the strokes.
            rounds: of finding contours anew.
        """
        self.neutral_mm = np.asarray(neutral_mm, dtype=np.float64)
        self.prior, self.stable = prior, np.asarray(stable)
        self._surface, self._noise, self._rounds = surface, noise or HandNoise(), rounds
        self._row = np.full(len(self.neutral_mm), -1)
        self._row[prior.vertices] = np.arange(len(prior.vertices))

    def solve(
        self,
        sequence_mm: np.ndarray,
        descriptors: np.ndarray,
        views: Mapping[int, Sequence[tuple[Sketch, Camera]]],
    ) -> PriorSolution:
        """Coefficients of all frames by the strokes of some.

        Args:
            sequence_mm: (F, V, 3) base, world of the cameras.
            descriptors: (F, D) of its frames, as the prior's.
            views: row of a frame -> its sketches and their cameras.

        Raises:
            InputError: no sketch, one of another image, or a camera that does not see the contour.
        """
        if not views:
            raise InputError("no sketch", "one or more frames", "Draw the lips first.")
        rows = np.array(sorted(views))
        z = self.prior.descriptors(descriptors)
        mean, among = self.prior.mean(z), self.prior.kernel(z[rows], z[rows])
        among = among + self.prior.shares[2] * np.eye(len(rows))
        settings = RefinementSettings()
        ready = [[SketchView.of(s, c, settings) for s, c in views[int(row)]] for row in rows]
        current, shift = mean[rows].copy(), np.zeros((len(rows), 3))
        for _ in range(self._rounds):
            found = [
                self._information(sequence_mm[row], current[j], shift[j], mean[row], ready[j])
                for j, row in enumerate(rows)
            ]
            matrix, right = (np.stack(part) for part in zip(*found, strict=True))
            current, shift = self._posterior(matrix, right, among, mean[rows])
        left = current - mean[rows]
        weights = self.prior.kernel(z, z[rows]) @ np.linalg.solve(among, left)
        result = mean + weights
        result[rows] = current
        variance = self.prior.shares.sum() - np.einsum(
            "fk,fk->f", self.prior.kernel(z, z[rows]),
            np.linalg.solve(among, self.prior.kernel(z[rows], z)).T,
        )  # fmt: skip
        spread = np.sqrt((self.prior.deviations**2 * (self.prior.modes_mm**2).sum(axis=1)).sum())
        each = spread / np.sqrt(len(self.prior.vertices))
        return PriorSolution(result, rows, each * np.sqrt(np.maximum(variance, 0.0)))

    def apply(self, sequence_mm: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
        """Meshes of a base `sequence_mm` (F, V, 3) with `coefficients` (F, r), world."""
        result = np.array(sequence_mm, dtype=np.float64)
        moved = self.prior.displacements(coefficients)
        for mesh, along in zip(result, moved, strict=True):
            mesh[self.prior.vertices] += along @ self._head_from_world(mesh)
        return result

    def _head_from_world(self, mesh_mm: np.ndarray) -> np.ndarray:
        target = self.neutral_mm[self.stable]
        return similarity_alignment(mesh_mm[self.stable], target, scale=1.0).rotation

    def _information(
        self,
        base_mm: np.ndarray,
        coefficients: np.ndarray,
        shift_mm: np.ndarray,
        mean: np.ndarray,
        views: Sequence[SketchView],
    ) -> tuple[np.ndarray, np.ndarray]:
        """J^T N^-1 J (p, p) and J^T N^-1 (r - J m) (p,) of a frame; p: r modes and the head's shift."""
        count = len(coefficients)
        modes = self.prior.modes_mm.reshape(count, -1, 3) @ self._head_from_world(base_mm)
        mesh = base_mm.copy()
        mesh[self.prior.vertices] += np.tensordot(coefficients, modes, axes=1)
        mesh += shift_mm
        matrix, right = np.zeros((count + 3, count + 3)), np.zeros(count + 3)
        matrix[count:, count:] = self._pose_precision(views[0].camera)
        for view in views:
            for name, segments in view.contours(mesh, self._surface).items():
                points, _ = segments.nearest(view.samples[name])
                at_mm = points.sample(mesh, self._surface.triangles)
                corners = points.corners(self._surface.triangles)
                rays = ray_constraints(
                    corners, points.barycentric, at_mm, view.camera, view.samples[name], 1.0
                )
                by_mode = self._by_mode(rays, modes)
                jacobian = np.concatenate([by_mode, rays.directions], axis=1)
                off = rays.target_mm + by_mode @ (coefficients - mean) + rays.directions @ shift_mm
                whitened = np.linalg.solve(self._noise_covariance(view, at_mm), jacobian)
                matrix += jacobian.T @ whitened
                right += whitened.T @ off
        return matrix, right

    def _by_mode(self, rays: LinearConstraints, modes: np.ndarray) -> np.ndarray:
        """What each ray measures of each mode (r, N, 3), (m, r)."""
        at = self._row[rays.vertices]
        shares = np.where(at < 0, 0.0, rays.coefficients)
        result: np.ndarray = np.einsum(
            "mk,rmkx,mx->mr", shares, modes[:, np.maximum(at, 0)], rays.directions, optimize=True
        )
        return result

    def _noise_covariance(self, view: SketchView, at_mm: np.ndarray) -> np.ndarray:
        """(2n, 2n) mm2 of the rays of a stroke whose n points are at (n, 3)."""
        noise, places = self._noise, np.linspace(0.0, 1.0, len(at_mm))
        distance = np.linalg.norm(at_mm - view.camera.centre_mm, axis=1).mean()
        hand_mm = noise.hand_px * distance / view.camera.calibration[0, 0]
        alike = np.exp(-0.5 * ((places[:, None] - places) / noise.alike) ** 2)
        return np.kron(np.eye(2), hand_mm**2 * alike + noise.detail_mm**2 * np.eye(len(places)))

    def _pose_precision(self, camera: Camera) -> np.ndarray:
        """(3, 3) inverse covariance of the base's place, world, mm-2."""
        ahead = camera.rotation[2]
        along = np.outer(ahead, ahead)
        noise = self._noise
        return (np.eye(3) - along) / noise.pose_mm**2 + along / noise.depth_mm**2

    def _posterior(
        self, matrix: np.ndarray, right: np.ndarray, among: np.ndarray, mean: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (k, r) and shifts (k, 3) of the sketched frames, all at once.

        Args:
            matrix: (k, p, p).
            right: (k, p), of `_information`.
            among: (k, k) kernel of the frames.
            mean: (k, r) prior.
        """
        k, p, _ = matrix.shape
        r = p - 3
        inverse = np.linalg.inv(among)
        system = np.zeros((k, p, k, p))
        modes = np.arange(r)
        system[:, modes, :, modes] = inverse / (self.prior.deviations**2)[:, None, None]
        frames = np.arange(k)
        system[frames, :, frames, :] += matrix
        solved = np.linalg.solve(system.reshape(k * p, k * p), right.ravel()).reshape(k, p)
        return mean + solved[:, :r], solved[:, r:]
