"""Actors whose expressions are their own, for the benchmark of guided correction."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.faces.model import FaceModel

N_FRAMES, NOISE_MM = 276, 0.03


def actor_take(face: FaceModel, weights: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(neutral (V, 3), meshes (F, V, 3)) mm of an actor whose expressions are the actor's own.

    Args:
        weights: (F, K) expression weights.
    """
    rng = np.random.default_rng([seed, 1600])
    identity = 0.7 * np.clip(rng.standard_normal(face.n_identities), -2, 2)
    neutral = face.neutral_of(identity)
    shapes = face.expressions_mm.astype(np.float64)
    for shape in shapes:
        turn = Rotation.from_rotvec(np.radians(6) * rng.normal(size=3)).as_matrix()
        reach = np.linalg.norm(shape, axis=1, keepdims=True)
        own = 0.35 * reach * smooth_field(neutral, rng)
        shape[:] = rng.uniform(0.75, 1.25) * shape @ turn.T + own
    take = neutral + np.tensordot(weights, shapes, axes=(1, 0))
    mouth = [i for i, n in enumerate(face.expression_names) if n.startswith(("mouth", "jaw"))]
    busiest = sorted(mouth, key=lambda i: -weights[:, i].std())[:10]
    size = np.linalg.norm(shapes, axis=2)
    for number, i in enumerate(busiest):
        for j in busiest[:number]:
            reach = np.sqrt(size[i] * size[j])[:, None]
            pair = 0.25 * reach * smooth_field(neutral, rng)
            take += (weights[:, i] * weights[:, j])[:, None, None] * pair
    take += NOISE_MM * rng.standard_normal(take.shape)
    return neutral, take


def smooth_field(points: np.ndarray, rng, length_mm: float = 12.0, waves: int = 40) -> np.ndarray:
    """Random vectors (V, 3) of unit variance that change over `length_mm`."""
    direction = rng.normal(size=(waves, 3)) / length_mm
    phase, size = rng.uniform(0, 2 * np.pi, waves), rng.normal(size=(waves, 3))
    return np.cos(points @ direction.T + phase) @ size / np.sqrt(waves / 2)
