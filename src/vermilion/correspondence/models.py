"""Correspondence of two topologies of one face model: by place, on the mean face, with the lips apart."""

from __future__ import annotations

import numpy as np

from vermilion.correspondence.correspondence import Correspondence, CorrespondenceSettings
from vermilion.correspondence.neutral import model_mouth_mask
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import mesh_corners
from vermilion.geometry.surface_points import SurfacePoints

#: Weight of jawOpen at which surfaces are bound: no lip binds to the other.
_APART = 0.5
_JAW = "jawOpen"


def models_apart(full: FaceModel, face: FaceModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The full model (W, 3) as open as the coarse one's neutral; both (W, 3), (V, 3) with the lips apart."""
    jaw = shape_of(full, _JAW)
    opened = full.neutral_mm + _slight_opening(full, face, jaw) * jaw
    apart = _APART if _JAW in face.expression_names else 0.0
    return opened, opened + apart * jaw, face.neutral_mm + apart * shape_of(face, _JAW)


def bind_models(full: FaceModel, face: FaceModel) -> SurfacePoints:
    """The point of the full model's surface at each vertex of the coarser one, V points."""
    _, pose, coarse_pose = models_apart(full, face)
    return Surface(pose, full.triangles).closest(coarse_pose)


def shape_of(model: FaceModel, name: str) -> np.ndarray:
    """Displacements (V, 3) of a shape; none where the model has no such shape."""
    if name not in model.expression_names:
        return np.zeros_like(model.neutral_mm)
    return model.expressions_mm[model.expression_names.index(name)].astype(np.float64)


def model_correspondence(
    full: FaceModel,
    face: FaceModel,
    bound: SurfacePoints,
    neutral_mm: np.ndarray,
    settings: CorrespondenceSettings,
) -> Correspondence:
    """The correspondence of a person whose accurate mesh has the topology of the full model.

    Both topologies are of one model, so every person has the same points; the mask is the person's own.

    Args:
        full: of the accurate mesh.
        face: of the coarse mesh.
        bound: V points of the full model (`bind_models`).
        neutral_mm: (V, 3) the person's coarse neutral, head frame.
        settings: those of the mask.
    """
    mask = model_mouth_mask(face, neutral_mm, settings)
    rigid = face.regions["rigid"].copy()
    rigid[mesh_corners(face.triangles, mask)] = False
    nearest = bound.triangle[face.triangles[:, 0]].astype(np.int32)
    return Correspondence(
        bound, nearest, mask, rigid, full.triangles, face.triangles,
        np.asarray(neutral_mm, dtype=np.float64),
    )  # fmt: skip


def _slight_opening(full: FaceModel, face: FaceModel, jaw: np.ndarray) -> float:
    """Weight of jawOpen that the coarser model's neutral has against the full one's."""
    moves = jaw[full.landmarks]
    off = face.neutral_mm[face.landmarks] - full.neutral_mm[full.landmarks]
    return float((moves * off).sum() / max((moves**2).sum(), 1e-12))
