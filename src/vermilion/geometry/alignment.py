"""Least-squares alignment of corresponding points: one similarity, and one rigid motion a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Similarity:
    """target = scale * rotation @ source + translation.

    Attributes:
        scale: target's length of the source's unit; 1 for a rigid motion.
        rotation: (3, 3).
        translation: (3,) in the target's unit.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray

    def apply(self, points: np.ndarray) -> np.ndarray:
        """The points (..., 3) of the source frame in the target frame, (..., 3)."""
        return self.scale * points @ self.rotation.T + self.translation

    def undo(self, points: np.ndarray) -> np.ndarray:
        """The points (..., 3) of the target frame in the source frame, (..., 3)."""
        return (points - self.translation) @ self.rotation / self.scale

    def turn(self, vectors: np.ndarray) -> np.ndarray:
        """Displacements `vectors` (..., 3) of the source frame in the target frame, (..., 3)."""
        return self.scale * vectors @ self.rotation.T


def similarity_alignment(
    source: np.ndarray,
    target: np.ndarray,
    weights: np.ndarray | None = None,
    scale: float | None = None,
) -> Similarity:
    """Weighted least squares of points onto corresponding points (Umeyama 1991).

    Args:
        source, target: (N, 3), each in its own unit and frame; finite.
        weights: (N,) non-negative, with a positive sum; None: all the same.
        scale: given scale; 1 aligns rigidly (Arun et al. 1987); None: estimated.

    Returns:
        the similarity that takes the source's frame to the target's.
    """
    weights = np.ones(len(source)) if weights is None else np.asarray(weights, dtype=float)
    weights = weights / weights.sum()
    source_mean, target_mean = weights @ source, weights @ target
    centred = source - source_mean
    u, singular, vt = np.linalg.svd(((target - target_mean) * weights[:, None]).T @ centred)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * signs) @ vt
    if scale is None:
        scale = float((singular * signs).sum() / (weights @ (centred**2).sum(axis=1)))
    return Similarity(scale, rotation, target_mean - scale * rotation @ source_mean)


@dataclass(frozen=True)
class FrameAlignment:
    """One rigid motion a frame: target = rotation @ source + translation.

    Attributes:
        rotations: (F, 3, 3); NaN for a frame that could not be aligned.
        translations_mm: (F, 3); NaN likewise.
        error_mm: (F,) weighted RMS distance of the points that were used, mm; NaN likewise.
    """

    rotations: np.ndarray
    translations_mm: np.ndarray
    error_mm: np.ndarray

    def apply(self, sequence_mm: np.ndarray) -> np.ndarray:
        """Points `sequence_mm` (F, V, 3) of the source's frames in the target's, (F, V, 3) float64."""
        return move_frames(sequence_mm, self.rotations, self.translations_mm)

    def __getitem__(self, frames: np.ndarray | slice) -> FrameAlignment:
        return FrameAlignment(
            self.rotations[frames], self.translations_mm[frames], self.error_mm[frames]
        )


def align_frames(
    sequence_mm: np.ndarray,
    target_mm: np.ndarray,
    weights: np.ndarray,
    *,
    trim: float = 0.0,
    rounds: int = 1,
) -> FrameAlignment:
    """Align each frame of a sequence rigidly to its target, by some of the vertices.

    Vertices that are not finite in a frame or its target are left out of that frame; a frame with
    fewer than three is not aligned.

    Args:
        sequence_mm: (F, V, 3) any world, mm; NaN where unknown.
        target_mm: (F, V, 3) or (V, 3) corresponding points, mm; NaN where unknown.
        weights: (V,) of each vertex in the least squares (bool, or area in mm2); 0 leaves it out.
        trim: share of the vertices that is left out of every round but the first: those that fitted
            worst in the round before (a brow that moves, a forehead that was not seen).
        rounds: of alignment.

    Returns:
        F motions from the sequence's world to the target's.
    """
    weights = np.asarray(weights, dtype=float)
    chosen, n_frames = np.flatnonzero(weights > 0), len(sequence_mm)
    target_mm = np.broadcast_to(target_mm, sequence_mm.shape)
    rotations, translations = np.full((n_frames, 3, 3), np.nan), np.full((n_frames, 3), np.nan)
    error_mm = np.full(n_frames, np.nan)
    for frame in range(n_frames):
        source, goal = (values[frame, chosen].astype(float) for values in (sequence_mm, target_mm))
        finite = np.isfinite(source).all(axis=1) & np.isfinite(goal).all(axis=1)
        if finite.sum() < 3:
            continue
        source, goal, kept = source[finite], goal[finite], weights[chosen][finite]
        for _ in range(rounds):
            found = similarity_alignment(source, goal, kept, scale=1.0)
            away = np.linalg.norm(found.apply(source) - goal, axis=1)
            error_mm[frame] = np.sqrt(np.average(away**2, weights=kept))
            kept = kept * (away <= np.quantile(away, 1.0 - trim))
        rotations[frame], translations[frame] = found.rotation, found.translation
    return FrameAlignment(rotations, translations, error_mm)


def move_frames(
    sequence_mm: np.ndarray, rotations: np.ndarray, translations_mm: np.ndarray
) -> np.ndarray:
    """Turn and shift each frame: rotation @ x + translation.

    Args:
        sequence_mm: (F, V, 3) in the world that the motions start from, mm.
        rotations: (F, 3, 3).
        translations_mm: (F, 3).

    Returns:
        (F, V, 3) float64 in the world that the motions lead to, mm.
    """
    turned = np.asarray(sequence_mm, np.float64) @ np.swapaxes(rotations, 1, 2)
    return turned + translations_mm[:, None]
