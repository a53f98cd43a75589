"""The model at samples of its skin: points, normals, and their derivatives by the blend weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import incidence, normalised, triangle_cross
from vermilion.geometry.surface_points import SurfacePoints


@dataclass(frozen=True)
class SampledFace:
    """One person's face at N samples, linear in the weights, head frame.

    Attributes:
        neutral_mm: (N, 3) points of the neutral.
        expressions_mm: (N, 3, K) float32, displacements at weight 1.
        neutral_normals: (N, 3) not normalised (area-weighted, mm2).
        expression_normals: (N, 3, K) float32, their change at weight 1, to first order.
    """

    neutral_mm: np.ndarray
    expressions_mm: np.ndarray
    neutral_normals: np.ndarray
    expression_normals: np.ndarray

    @classmethod
    def of(
        cls,
        model: FaceModel,
        neutral_mm: np.ndarray,
        samples: SurfacePoints,
        displacements_mm: np.ndarray | None = None,
    ) -> SampledFace:
        """Sample a face.

        Args:
            model: topology and expressions.
            neutral_mm: (V, 3) the person's neutral, head frame.
            samples: N places on the mesh.
            displacements_mm: (K, V, 3) shapes at weight 1; the model's expressions by default.
        """
        shapes = model.expressions_mm if displacements_mm is None else displacements_mm
        at = samples.matrix(model.triangles, model.n_vertices)
        to_vertices = at @ incidence(model.triangles, model.n_vertices)
        change = np.stack(
            [to_vertices @ cross_change(neutral_mm, model.triangles, shape) for shape in shapes],
            axis=-1,
        )
        moved = np.stack([at @ shape.astype(np.float64) for shape in shapes], axis=-1)
        cross = to_vertices @ triangle_cross(neutral_mm, model.triangles)
        return cls(at @ neutral_mm, moved.astype(np.float32), cross, change.astype(np.float32))

    def points(self, weights: np.ndarray) -> np.ndarray:
        """Points (N, 3) mm of `weights` (K,)."""
        return self.neutral_mm + _mixed(self.expressions_mm, weights)

    def normals(self, weights: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) of `weights` (K,), to first order."""
        return normalised(self.neutral_normals + _mixed(self.expression_normals, weights))

    def through_normals(self, weights: np.ndarray, by_normal: np.ndarray) -> np.ndarray:
        """Derivative (N, C, K) by the weights of C functions of the unit normal (chain rule).

        Args:
            weights: (K,) where to differentiate.
            by_normal: (N, C, 3) derivative of the functions by the unit normal.
        """
        cross = self.neutral_normals + _mixed(self.expression_normals, weights)
        length = np.linalg.norm(cross, axis=1)[:, None, None]
        unit = cross[:, None] / length
        across = by_normal - (by_normal * unit).sum(axis=2, keepdims=True) * unit
        return (across / length).astype(np.float32) @ self.expression_normals

    def __getitem__(self, rows: np.ndarray | slice) -> SampledFace:
        return SampledFace(
            self.neutral_mm[rows],
            self.expressions_mm[rows],
            self.neutral_normals[rows],
            self.expression_normals[rows],
        )


def cross_change(
    vertices_mm: np.ndarray, triangles: np.ndarray, displacement_mm: np.ndarray
) -> np.ndarray:
    """First-order change (T, 3) of `triangle_cross` under a displacement.

    Args:
        vertices_mm: (V, 3).
        triangles: (T, 3).
        displacement_mm: (V, 3).
    """
    a, b, c = (vertices_mm[triangles[:, k]] for k in range(3))
    da, db, dc = (displacement_mm[triangles[:, k]].astype(np.float64) for k in range(3))
    return np.cross(db - da, c - a) + np.cross(b - a, dc - da)


def _mixed(shapes: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Sum (N, 3) of `shapes` (N, 3, K) times `weights` (K,), in the precision of the shapes.

    As one matrix of 3 N rows: numpy makes a product of each of N small matrices otherwise.
    """
    flat = shapes.reshape(-1, shapes.shape[2])
    return (flat @ weights.astype(shapes.dtype)).reshape(shapes.shape[:2])
