"""Template to landmarks: similarity, identity, then a smooth deformation (Lips16 3.1)."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import similarity_alignment
from vermilion.multiview.solver import ThinPlate, solve_displacement
from vermilion.multiview.triangulate import Triangulated


def fit_template(
    model: FaceModel, landmarks: Triangulated, *, identity_sigma_mm: float, iterations: int = 10
) -> np.ndarray:
    """Similarity and identity in turn, robustly weighted.

    Args:
        model: the template.
        landmarks: (66,) of the neutral; those not valid are left out.
        identity_sigma_mm: expected error of a landmark; identities have unit deviation.

    Returns:
        (V, 3) vertices in the world, mm.
    """
    use = landmarks.valid
    target, ids = landmarks.points_mm[use], model.landmarks[use]
    confidence = landmarks.weights[use]
    modes = model.identities_mm[:, ids].astype(np.float64)
    identity = np.zeros(model.n_identities)
    weights = confidence
    for _ in range(iterations):
        source = model.neutral_mm[ids] + np.tensordot(identity, modes, axes=1)
        similarity = similarity_alignment(source, target, weights)
        if model.n_identities:
            rows = similarity.turn(modes).reshape(len(modes), -1).T
            left = (target - similarity.apply(model.neutral_mm[ids])).reshape(-1)
            w = np.repeat(weights, 3) / identity_sigma_mm**2
            gram = rows.T @ (w[:, None] * rows) + np.eye(len(modes))
            identity = np.linalg.solve(gram, rows.T @ (w * left))
        fitted = similarity.apply(model.neutral_mm[ids] + np.tensordot(identity, modes, axes=1))
        distance = np.linalg.norm(fitted - target, axis=1)
        weights = confidence / np.maximum(distance / (2 * identity_sigma_mm), 1.0)
    return similarity.apply(model.neutral_of(identity))


def deform_to_landmarks(
    vertices_mm: np.ndarray,
    plate: ThinPlate,
    vertex_ids: np.ndarray,
    landmarks: Triangulated,
    *,
    length_mm: float,
    sigma_mm: float,
) -> np.ndarray:
    """Laplacian deformation of the fitted template onto the landmarks, (V, 3) mm.

    A landmark weighs as an area of `length_mm` squared, less where it lies over `sigma_mm` away.

    Args:
        vertices_mm: (V, 3) the fitted template, world, mm.
        plate: of it.
        vertex_ids: (66,) vertices of the landmarks.
        landmarks: those not valid are left out.
        length_mm: stiffness (see `solver`).
        sigma_mm: expected error of a landmark.
    """
    use = landmarks.valid
    ids, target = vertex_ids[use], landmarks.points_mm[use]
    offset = target - vertices_mm[ids]
    distance = np.linalg.norm(offset, axis=1)
    weight = landmarks.weights[use] / np.maximum(distance / (2 * sigma_mm), 1.0)
    weight = weight * length_mm**2 / plate.areas_mm2[ids]
    total = np.zeros(len(vertices_mm))
    np.add.at(total, ids, weight)
    right = np.zeros_like(vertices_mm)
    np.add.at(right, ids, weight[:, None] * offset)
    blocks = total[:, None, None] * np.eye(3)
    return vertices_mm + solve_displacement(plate, blocks, right, length_mm)
