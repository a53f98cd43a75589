"""The linear space in which a foreign sequence is described: blend shapes of its tracker, or modes.

Lips16 5.1 takes the tracker's own coefficients psi. Where the weights W (N, K) of its blend shapes are
given, their shapes S follow from the meshes X by least squares,

    min_S |W S - X|^2 + r |S|^2.

Else the space is that of the principal components of the training frames' displacements from their
neutrals, under the area-weighted mean over the face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import vertex_areas

_RIDGE = 1e-4  # of the mean square of the weights
#: A mode at weight 1, in its largest coefficient of the training: room for frames that go farther.
_ROOM = 1.25
#: Ends of the names of a mode's two directions.
UP, DOWN = "_up", "_down"


def with_blend_shapes(
    model: FaceModel, displacements_mm: np.ndarray, weights: np.ndarray, names: Sequence[str]
) -> FaceModel:
    """The model with the tracker's own blend shapes.

    Args:
        model: of the tracker's topology, V vertices.
        displacements_mm: (N, V, 3) of training frames from their neutral, head frame.
        weights: (N, K) their blend weights.
        names: K names.
    """
    weights = np.asarray(weights, dtype=np.float64)
    square = weights.T @ weights
    ridge = _RIDGE * np.trace(square) / max(len(square), 1)
    system = np.linalg.solve(square + (ridge + 1e-12) * np.eye(len(square)), weights.T)
    shapes = np.tensordot(system, displacements_mm, axes=1)
    return replace(model, expression_names=tuple(names), expressions_mm=shapes.astype(np.float32))


def with_modes(
    model: FaceModel, displacements_mm: np.ndarray, variance: float, most: int
) -> FaceModel:
    """The model with modes of the training frames as its expressions, each in both directions.

    Expression 2k is mode k, 2k + 1 its opposite, so that weights lie in [0, 1].

    Args:
        model: of the tracker's topology, V vertices.
        displacements_mm: (N, V, 3) of training frames from their neutral, head frame.
        variance: share of the variance that the modes hold.
        most: modes at most.
    """
    flat = np.asarray(displacements_mm, dtype=np.float64).reshape(len(displacements_mm), -1)
    weighted = flat * face_root(model)
    values, vectors = np.linalg.eigh(weighted @ weighted.T)
    values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
    share = np.cumsum(values) / max(values.sum(), 1e-300)
    count = int(np.searchsorted(share, variance)) + 1
    count = min(count, most, int((values > 1e-12 * values[0]).sum()))
    vectors = vectors[:, :count]
    # Singular vectors have no sign of their own: the largest entry is positive.
    largest = np.abs(vectors).argmax(axis=0)
    vectors = vectors * np.sign(vectors[largest, np.arange(count)])
    shapes = (vectors.T @ flat) * (_ROOM * np.abs(vectors).max(axis=0))[:, None]
    shapes = shapes.reshape(count, -1, 3)
    both = np.stack([shapes, -shapes], axis=1).reshape(2 * count, -1, 3)
    names = [f"mode_{k:02d}{way}" for k in range(count) for way in (UP, DOWN)]
    return replace(model, expression_names=tuple(names), expressions_mm=both.astype(np.float32))


def has_modes(model: FaceModel) -> bool:
    """Whether the expressions of a model are modes in both directions (`with_modes`)."""
    names = model.expression_names
    return bool(names) and all(name.endswith((UP, DOWN)) for name in names)


def mode_weights(model: FaceModel, displacements_mm: np.ndarray) -> np.ndarray:
    """Weights (F, K) in [0, 1] of the modes of a model that come nearest to displacements (F, V, 3)."""
    root = face_root(model)
    shapes = model.expressions_mm[0::2].astype(np.float64)
    matrix = (shapes.reshape(len(shapes), -1) * root).T
    flat = np.asarray(displacements_mm, dtype=np.float64).reshape(len(displacements_mm), -1) * root
    found = np.linalg.lstsq(matrix, flat.T, rcond=None)[0].T
    both = np.stack([found, -found], axis=2).reshape(len(found), -1)
    return np.clip(both, 0.0, 1.0)


def face_root(model: FaceModel) -> np.ndarray:
    """(3 V,) square roots of each vertex's share of the face's area, a coordinate each."""
    area = vertex_areas(model.neutral_mm, model.triangles) * model.regions["face"]
    return np.repeat(np.sqrt(area / area.sum()), 3)
