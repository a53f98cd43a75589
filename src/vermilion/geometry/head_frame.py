"""The canonical head frame: layers and integration know no head motion (Lips16 5.2, last line)."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.mesh import rigid_alignment


def head_from_world(
    vertices_mm: np.ndarray, rotation: np.ndarray, translation_mm: np.ndarray
) -> np.ndarray:
    """(F, V, 3) world -> head frame, float64; (F, 3, 3), (F, 3) are `world_from_head`."""
    centred = np.asarray(vertices_mm, np.float64) - translation_mm[:, None]
    return centred @ rotation


def world_from_head(
    vertices_mm: np.ndarray, rotation: np.ndarray, translation_mm: np.ndarray
) -> np.ndarray:
    """(F, V, 3) head frame -> world, float64."""
    return (
        np.asarray(vertices_mm, np.float64) @ np.swapaxes(rotation, 1, 2) + translation_mm[:, None]
    )


def align_frames(
    sequence_mm: np.ndarray, target_mm: np.ndarray, weight: np.ndarray, trim: float = 0.2
) -> tuple[np.ndarray, np.ndarray]:
    """Bring each frame rigidly onto its target by some of the vertices.

    Twice: the share `trim` of the vertices that fit worst is left out the second time (a brow that
    moves, a forehead that was not seen).

    Args:
        sequence_mm: (F, V, 3).
        target_mm: (F, V, 3) or (V, 3).
        weight: (V,) of each vertex in the least squares, bool or float; 0 leaves it out.
        trim: 0 for once, with all vertices.

    Returns:
        ((F, V, 3) aligned, (F,) RMS mm of the vertices kept). NaN where a frame is not finite.
    """
    target, chosen = np.broadcast_to(target_mm, sequence_mm.shape), np.asarray(weight) > 0
    aligned = np.full(sequence_mm.shape, np.nan)
    error_mm = np.full(len(sequence_mm), np.nan)
    for f in range(len(sequence_mm)):
        source, goal = sequence_mm[f, chosen], target[f, chosen]
        if not (np.isfinite(source).all() and np.isfinite(goal).all()):
            continue
        weights = np.asarray(weight, dtype=float)[chosen]
        for _ in range(2 if trim > 0 else 1):
            rotation, translation = rigid_alignment(source, goal, weights)
            residual = np.linalg.norm(source @ rotation.T + translation - goal, axis=1)
            error_mm[f] = np.sqrt(np.average(residual**2, weights=weights))
            weights = weights * (residual <= np.quantile(residual, 1.0 - trim))
        aligned[f] = sequence_mm[f] @ rotation.T + translation
    return aligned, error_mm
