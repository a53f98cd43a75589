"""The baseline of Lips16 section 6: a model-based tracker with lip shapes, aligned to the contours.

With base track C, displacements B_k of its own expressions and of the lip shapes, and box-constrained
weights w, the mesh C + sum_k w_k B_k minimises, in each frame for itself,

    mean_i (n_i . (p_i - q_i(w)))^2  +  ridge * sum_k (w_k |B_k|)^2

where p_i are contour points found in the image, n_i the direction across the contour, and q_i the
projections of their points on the mesh, in millimetres at the mouth's depth. The outer contour is an
iso-line of the model. The inner one is an occluding contour: which points of the lips form it depends
on the shape, so that it is found again in turn with the weights (Anderson et al. 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.contours.curves import inward_normals, smoothed_ring
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.image_contours import ImageContours
from vermilion.faces.model import FaceModel
from vermilion.features.occluding import OccludingContour
from vermilion.features.rings import lip_rings
from vermilion.geometry.camera import Camera
from vermilion.geometry.head_frame import head_from_world, world_from_head
from vermilion.geometry.surface_points import SurfacePoints

_ROUNDS = 8
_LEAST_POINTS = 20
_LEAST_MOVE_MM = 0.2


class ContourTracker:
    """A person's tracker with lip shapes; build it once.

    Args:
        model: the tracker's.
        lip_displacements_mm: (S, V, 3) of the lip shapes on the person's neutral, head frame.
        n_samples: of each contour.
        ridge: cost of a weight that moves the lips by 1 mm.

    Attributes:
        displacements_mm: (K, V, 3) of the expressions that move the lips, then of the lip shapes.
        expressions: ids of the former in the model.
    """

    def __init__(
        self, model: FaceModel, lip_displacements_mm: np.ndarray, n_samples: int, ridge: float
    ):
        lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
        moves = np.linalg.norm(model.expressions_mm[:, lips], axis=2).mean(axis=1)
        self.expressions = np.flatnonzero(moves > _LEAST_MOVE_MM)
        self.displacements_mm = np.concatenate(
            [model.expressions_mm[self.expressions], lip_displacements_mm]
        ).astype(np.float64)
        size = (self.displacements_mm[:, lips] ** 2).sum(axis=2).mean(axis=1)
        self.penalty = np.sqrt(ridge * size)
        ring = lip_rings(model, n_samples)[0]
        self.outer = SurfacePoints.on_edges(ring.start, ring.end, ring.fraction, model.triangles)
        self.occluding = OccludingContour.of(model)

    def track(self, take: CoarseTake, image: ImageContours, weights: np.ndarray) -> np.ndarray:
        """Meshes (F, V, 3) mm, world, fitted to the contours in the take's images.

        A frame with too few contour points keeps its coarse mesh.

        Args:
            take: the base track.
            image: contours in the images of the same frames.
            weights: (F, all expressions of the model) of the base track.
        """
        result = head_from_world(take.coarse_mm, take.rotation, take.translation_mm)
        of_shapes = len(self.displacements_mm) - len(self.expressions)
        for f in range(len(result)):
            now = np.clip(weights[f, self.expressions], 0.0, 1.0)
            bounds = (
                np.concatenate([-now, np.zeros(of_shapes)]),
                np.append(1.0 - now, np.ones(of_shapes)),
            )
            frame = _FrameView(image.camera, take.rotation[f], take.translation_mm[f])
            fitted = self._fit(frame, result[f], bounds, image, f)
            result[f] += np.tensordot(fitted, self.displacements_mm, 1)
        return world_from_head(result, take.rotation, take.translation_mm)

    def _fit(self, view: _FrameView, base_mm, bounds, found: ImageContours, f: int) -> np.ndarray:
        """Weights (K,) of a frame, from the base mesh (V, 3) in the head frame."""
        from scipy.optimize import lsq_linear

        weights = np.zeros(len(self.displacements_mm))
        if found.outer_found[f].sum() < _LEAST_POINTS:
            return weights
        seen = found.outer_found[f]
        across = inward_normals(smoothed_ring(found.outer_px[f], 2))[seen]
        outer = self.outer[seen]
        triangles = self.occluding.triangles
        outer_basis = outer.sample(self.displacements_mm, triangles)
        for _ in range(_ROUNDS):
            mesh = base_mm + np.tensordot(weights, self.displacements_mm, 1)
            parts = [
                view.equations(
                    outer.sample(mesh, triangles), outer_basis, found.outer_px[f, seen], across
                )
            ]
            inner, rows, up = self.occluding.match(
                view.project(self.occluding.on(mesh)), found.outer_px[f],
                found.inner_px[f], found.inner_found[f],
            )  # fmt: skip
            if len(inner):
                occluding = self.occluding.points[rows]
                parts.append(
                    view.equations(
                        occluding.sample(mesh, triangles),
                        occluding.sample(self.displacements_mm, triangles),
                        found.inner_px[f, inner],
                        np.broadcast_to(up, (len(inner), 2)),
                    )
                )
            matrix = np.concatenate([part[0] for part in parts])
            right = np.concatenate([part[1] for part in parts]) + matrix @ weights
            scale = 1.0 / np.sqrt(len(matrix))
            new = lsq_linear(
                np.concatenate([scale * matrix, np.diag(self.penalty)]),
                np.concatenate([scale * right, np.zeros(len(weights))]),
                bounds,
                method="bvls",
            ).x
            done = np.abs(new - weights).max() < 1e-3
            weights = new
            if done:
                break
        return weights


@dataclass(frozen=True)
class _FrameView:
    """A frame's camera, seen from the head frame."""

    camera: Camera
    rotation: np.ndarray
    translation_mm: np.ndarray

    def project(self, points_mm: np.ndarray) -> np.ndarray:
        """`points_mm` (N, 3), head frame, in pixels (N, 2)."""
        return self.camera.project(points_mm @ self.rotation.T + self.translation_mm)

    def equations(self, points_mm, basis_mm, wanted_px, across) -> tuple[np.ndarray, np.ndarray]:
        """Matrix (N, K) and right side (N,) in mm of across . (wanted - project(points + basis w)).

        Args:
            points_mm: (N, 3) head frame; basis_mm: (K, N, 3); wanted_px, across: (N, 2).
        """
        world = points_mm @ self.rotation.T + self.translation_mm
        depth = self.camera.to_camera(world)[:, 2]
        px_per_mm = np.diag(self.camera.calibration)[:2].mean() / depth.mean()
        ray = np.einsum("ni,nij->nj", across, self.camera.pixel_jacobian(world)) @ self.rotation
        matrix = np.einsum("knd,nd->nk", basis_mm, ray) / px_per_mm
        right = ((wanted_px - self.project(points_mm)) * across).sum(axis=1) / px_per_mm
        return matrix, right
