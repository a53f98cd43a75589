"""Expressions that are an actor's own: nobody smiles exactly as the model's mean person does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.rotations import rotation_matrix

#: At a spread of 1: deviation of the logarithm of a shape's gain, of its turn (degrees), and of the
#: smooth field by which each of its components is scaled from place to place.
_GAIN, _TURN_DEG, _FIELD = 0.2, 10.0, 0.35
#: Wavelengths of the smooth field (mm), and how many waves it is made of.
_WAVELENGTHS_MM, _WAVES = (50.0, 140.0), 6


def with_own_expressions(model: FaceModel, seed: int, spread: float) -> FaceModel:
    """The model with the expressions of one actor.

    Each shape has a gain and a direction of its own, and a smooth field scales it from place to place,
    so that it is not symmetric either. What a shape does not move stays still.

    Args:
        model: V vertices, K expressions.
        seed: of the actor.
        spread: 0 leaves the model as it is; 1 is as different as people are.
    """
    if spread == 0.0:
        return model
    rng = np.random.default_rng([seed, 7010])
    shapes = np.empty_like(model.expressions_mm)
    for k, shape in enumerate(model.expressions_mm):
        gain = np.exp(spread * _GAIN * np.clip(rng.standard_normal(), -2.0, 2.0))
        turn = rotation_matrix(np.radians(spread * _TURN_DEG) * rng.standard_normal(3) / np.sqrt(3))
        field = np.stack([_smooth_field(model.neutral_mm, rng) for _ in range(3)], axis=1)
        shapes[k] = gain * (shape * (1.0 + spread * _FIELD * field)) @ turn.T
    return replace(model, expressions_mm=shapes)


def _smooth_field(points_mm: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Values (V,) of deviation 1 of plane waves in all directions, at points (V, 3)."""
    directions = rng.standard_normal((_WAVES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    waves = 2.0 * np.pi / rng.uniform(*_WAVELENGTHS_MM, _WAVES)
    phases = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    return np.cos(points_mm @ (directions.T * waves) + phases).sum(axis=1) * np.sqrt(2.0 / _WAVES)
