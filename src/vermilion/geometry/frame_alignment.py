"""One rigid alignment a frame, on the face outside the mouth mask."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.mesh import rigid_alignment


def align_frames(
    sequence_mm: np.ndarray, target_mm: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (F, 3, 3) and translations (F, 3) from a sequence to its target, frame by frame.

    Weighted least squares over the vertices with a positive weight. A correction moves them
    little, but for the motion of the whole head.

    Args:
        sequence_mm: (F, V, 3), any world.
        target_mm: (F, V, 3) corresponding points; NaN where there is none.
        weights: (V,) areas in mm2.
    """
    chosen = np.flatnonzero(weights > 0)
    rotations, translations = np.empty((len(sequence_mm), 3, 3)), np.empty((len(sequence_mm), 3))
    for index, (source, target) in enumerate(zip(sequence_mm, target_mm, strict=True)):
        source, target = source[chosen].astype(float), target[chosen].astype(float)
        finite = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1)
        if finite.sum() < 3:
            rotations[index], translations[index] = np.nan, np.nan
            continue
        rotations[index], translations[index] = rigid_alignment(
            source[finite], target[finite], weights[chosen][finite]
        )
    return rotations, translations


def moved(sequence_mm: np.ndarray, rotations: np.ndarray, translations: np.ndarray) -> np.ndarray:
    """(F, V, 3) after each frame's rotation (F, 3, 3) and translation (F, 3)."""
    return np.matmul(sequence_mm, rotations.transpose(0, 2, 1)) + translations[:, None]
