"""Vertex offsets outside the model's space: the medium-scale corrective layer of Lips16 3.2.

The offsets d are parallel to the image. Gauss-Newton minimises

    strength / 2 * mean over visible samples of rho(|display(image) - display(albedo * SH(normal))|)
    + 1 / (2 sigma^2 length^2) * integral of |d|^2 + length^4 |Laplacian d|^2

over the surface: the prior takes d for a smooth random field of deviation `sigma_mm` that is
correlated over `length_mm`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.appearance.estimate import Appearance
from vermilion.appearance.harmonics import irradiance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.faces.model import FaceModel
from vermilion.geometry.rotations import rotation_matrix
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.imaging.display import display_slope, to_display_values
from vermilion.tracking.image_fit.frame_fit import FrameView
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.observation import project


@dataclass(frozen=True)
class OffsetSettings:
    """How far and how finely the offsets may bend the model.

    Attributes:
        sigma_mm: deviation of the offsets.
        length_mm: correlation length of the offsets.
        sigma, robust_sigmas, strength: of the image, as in `FrameFitSettings`.
        iterations: Gauss-Newton steps at each resolution, coarsest first; 0 skips a resolution.
    """

    sigma_mm: float = 2.0
    length_mm: float = 20.0
    sigma: float = 6.0
    robust_sigmas: float = 2.0
    strength: float = 1000.0
    iterations: Sequence[int] = (0, 1, 2)


class OffsetSolver:
    """Solves for the offsets of one person's mesh; the parts shared by all frames are made once."""

    def __init__(
        self,
        model: FaceModel,
        neutral_mm: np.ndarray,
        face: SampledFace,
        appearance: Appearance,
        settings: OffsetSettings,
    ):
        """`neutral_mm` (V, 3) is the person's, head frame; `face` is sampled as `appearance` is."""
        self.face, self.appearance, self.settings = face, appearance, settings
        self.at = appearance.samples.matrix(model.triangles, model.n_vertices)
        laplacian, mass = cotangent_laplacian(neutral_mm, model.triangles)
        areas = np.maximum(mass.diagonal(), 1e-3 * mass.diagonal().mean())
        bending = laplacian @ sparse.diags(1.0 / areas) @ laplacian
        s = settings
        stiffness = sparse.diags(areas) + s.length_mm**4 * bending
        self.stiffness = sparse.csr_matrix(stiffness / (s.sigma_mm * s.length_mm) ** 2)

    def solve(self, view: FrameView) -> np.ndarray:
        """Offsets (V, 3) mm, head frame, of the frame whose pose and weights are `view.start`."""
        x = view.start
        rotation = rotation_matrix(x[:3]) @ view.reference
        rows = np.flatnonzero((view.trust > 0) & (self.appearance.seen > 0))
        face, at = self.face[rows], self.at[rows]
        base = face.points(x[N_POSE:]) @ rotation.T + x[3:6]
        shading = irradiance(face.normals(x[N_POSE:]) @ rotation.T, self.appearance.light)
        across = np.zeros((at.shape[1], 2))
        counts = self.settings.iterations
        for level, count in zip(reversed(range(len(counts))), counts, strict=True):
            predicted = to_display_values(self.appearance.albedo[level][rows] * shading)
            for _ in range(count):
                points = base.copy()
                points[:, :2] += at @ across
                across = self._step(view, level, at, points, predicted, view.trust[rows], across)
        return across @ rotation[:2]

    def _step(self, view, level, at, points, predicted, trust, across):
        """The offsets (V, 2), parallel to the image, that minimise the energy's quadratic."""
        s = self.settings
        found, slopes, inside = view.levels[level].sample(project(points, view.focal_px))
        error = to_display_values(found) - predicted
        jacobian = display_slope(found)[..., None] * slopes
        jacobian = jacobian * (view.focal_px / points[:, 2])[:, None, None]
        weight = trust * inside
        robust = 1.0 / (1.0 + (error**2).sum(axis=1) / (3 * s.sigma**2 * s.robust_sigmas**2))
        weight = s.strength / (3 * s.sigma**2) * weight * robust / max(weight.sum(), 1e-9)
        square = np.einsum("nci,ncj,n->ijn", jacobian, jacobian, weight, optimize=True)
        target = np.einsum("ncj,nj->nc", jacobian, at @ across) - error
        right = at.T @ np.einsum("nci,nc,n->ni", jacobian, target, weight, optimize=True)
        blocks = [
            [at.T @ sparse.diags(square[i, j]) @ at + (i == j) * self.stiffness for j in range(2)]
            for i in range(2)
        ]
        solved = CholeskyFactor(sparse.bmat(blocks, format="csc")).solve(right.T.reshape(-1))
        return solved.reshape(2, -1).T
