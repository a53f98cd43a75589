"""The full face model, with eyes, teeth and neck, in the place of the tracker's coarser mesh.

The full model takes the person and the weights of the track; what the sequence shows beyond that
(the correction, the person outside the model's space) is carried over from the nearest points of the
sequence's surface, and fades out where the coarser mesh ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from vermilion.correspondence.models import bind_models, models_apart, shape_of
from vermilion.export.animation import Animation, NamedShapes
from vermilion.export.shape_basis import ShapeBasis
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import connected_parts, unique_edges
from vermilion.geometry.polygons import Polygons
from vermilion.geometry.surface_points import SurfacePoints

#: Beyond the coarser mesh, what is carried over fades out over this distance.
_FADE_MM = 15.0


@dataclass(frozen=True)
class FullFace:
    """The full model of a person, driven by a coarser sequence.

    Attributes:
        polygons: quads where the model has them.
        uv: (W, 2), v up.
        neutral_mm: (W, 3) head frame.
        shapes_mm: (K, W, 3) the track's named shapes on the full mesh.
        carry: (W, V) sparse: displacements of the coarser mesh on the full one.
        lips: (W,) bool, the vermilion.
    """

    polygons: Polygons
    uv: np.ndarray
    neutral_mm: np.ndarray
    shapes_mm: np.ndarray
    carry: sparse.csr_matrix
    lips: np.ndarray

    @classmethod
    def of(
        cls,
        full: FaceModel,
        face: FaceModel,
        neutral_mm: np.ndarray,
        identity: np.ndarray,
        shapes: NamedShapes,
    ) -> FullFace:
        """Bind the model `full` to a sequence of the topology of `face`.

        Args:
            full: the whole head.
            face: the sequence's model: part of the same face, coarser.
            neutral_mm: (V, 3) the person's neutral in that topology, head frame.
            identity: (I,) the person's coefficients.
            shapes: the named shapes of the sequence.
        """
        opened, pose, coarse_pose = models_apart(full, face)
        to_full = _carry(pose, full, coarse_pose, face.triangles)
        sample = bind_models(full, face).matrix(full.triangles, full.n_vertices)
        count = min(len(identity), full.n_identities)
        person = opened + np.tensordot(
            identity[:count], full.identities_mm[:count].astype(np.float64), axes=1
        )

        def follows(own: np.ndarray, coarse: np.ndarray) -> np.ndarray:
            return own + to_full @ (coarse - sample @ own)

        named = [
            follows(shape_of(full, name), np.asarray(shape, dtype=np.float64))
            for name, shape in zip(shapes.names, shapes.shapes_mm, strict=True)
        ]
        return cls(
            Polygons.with_quads(full.triangles), full.uv, follows(person, neutral_mm),
            np.array(named, dtype=np.float32).reshape(-1, full.n_vertices, 3), to_full,
            full.regions["vermilion_upper"] | full.regions["vermilion_lower"],
        )  # fmt: skip

    def vertices_mm(self, coarse: Animation, row: int) -> np.ndarray:
        """Vertices (W, 3) of frame `row` of the coarser animation, world."""
        weights = coarse.shapes.weights[row]
        local = coarse.head.to_head(row, np.asarray(coarse.vertices_mm[row], dtype=np.float64))
        known = coarse.neutral_mm + np.tensordot(weights, coarse.shapes.shapes_mm, axes=1)
        own = self.neutral_mm + np.tensordot(weights.astype(np.float32), self.shapes_mm, axes=1)
        return coarse.head.to_world(row, own + self.carry @ (local - known))

    def carried(self, values: np.ndarray) -> np.ndarray:
        """The `values` (V, c) of the coarser mesh on this one, (W, c); far from it their mean."""
        reach = np.asarray(self.carry.sum(axis=1)).reshape(-1, 1)
        return self.carry @ values + (1 - reach) * values.mean(axis=0)

    def animation(self, coarse: Animation, vertices_mm: np.ndarray) -> Animation:
        """The coarser animation with this mesh, whose vertices_mm are (F, W, 3), world."""
        shapes = replace(coarse.shapes, shapes_mm=self.shapes_mm)
        return replace(
            coarse, vertices_mm=vertices_mm, polygons=self.polygons, uv=self.uv,
            neutral_mm=self.neutral_mm, shapes=shapes,
        )  # fmt: skip

    def basis(self, coarse: ShapeBasis) -> ShapeBasis:
        """The blend shapes of the coarser mesh on this one."""
        return coarse.on_other_topology(self.carry, self.neutral_mm, self.shapes_mm)


def shapes_on_coarse(full: FaceModel, face: FaceModel) -> NamedShapes:
    """All shapes of the full model on the mesh of `face`, (K, V, 3), without weights (0, K)."""
    sample = bind_models(full, face).matrix(full.triangles, full.n_vertices)
    shapes = np.stack([sample @ shape.astype(np.float64) for shape in full.expressions_mm])
    return NamedShapes(full.expression_names, shapes, np.zeros((0, len(shapes))))


def _carry(
    pose: np.ndarray, full: FaceModel, coarse: np.ndarray, triangles: np.ndarray
) -> sparse.csr_matrix:
    """(W, V): nearest points of the coarser surface, for the skin, fading out beyond its border."""
    part = connected_parts(unique_edges(full.triangles), full.n_vertices)
    skin = np.isin(part, np.unique(part[full.landmarks]))
    skin &= ~full.regions["teeth"] & ~full.regions["eyes"]
    found = Surface(coarse, triangles).closest(pose)
    assert found.distance_mm is not None
    weight = np.where(skin, np.exp(-((found.distance_mm / _FADE_MM) ** 2)), 0.0)
    at = SurfacePoints(found.triangle, found.barycentric).matrix(triangles, len(coarse))
    return sparse.csr_matrix(sparse.diags(weight) @ at)
