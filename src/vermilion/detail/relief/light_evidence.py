"""One light that fits all frames of a take, on the geometry with its relief (Mono13 section 8).

The albedo of the first frames is kept. Each frame adds its own normal equations of the nine harmonics, so
that chunks can be looked at apart and added up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.appearance.estimate import light_equations
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.imaging.images import srgb_to_linear
from vermilion.storage.arrays import read_arrays, write_arrays

#: Weight of the light of the first frames against all frames, as a share of the equations' size.
_RIDGE = 1e-4


@dataclass(frozen=True)
class LightEvidence:
    """Normal equations of F frames, a channel each.

    Attributes:
        frames: (F,) int numbers of the frames.
        matrix: (F, 3, 9, 9).
        right: (F, 3, 9).
    """

    frames: np.ndarray
    matrix: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, found: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> LightEvidence:
        """Of `found` (F,): frame, and (3, 9, 9) and (3, 9) as `frame_evidence` gives them; F may be 0."""
        frames = np.array([frame for frame, _, _ in found], dtype=int)
        matrices = np.array([matrix for _, matrix, _ in found]).reshape(-1, 3, 9, 9)
        return cls(frames, matrices, np.array([right for _, _, right in found]).reshape(-1, 3, 9))

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, frames=self.frames, matrix=self.matrix, right=self.right)

    @classmethod
    def load(cls, path: str | Path) -> LightEvidence:
        """Read what `save` wrote."""
        return cls(**read_arrays(path, "evidence of a light", ["frames", "matrix", "right"]))


def frame_evidence(observed: SkinObservation, start: ClipLight) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations (3, 9, 9) and (3, 9) of a frame, colours weighted as `start` explains them.

    Args:
        observed: image at the skin's triangles, with the normals of the mesh with relief.
        start: light and albedo of the first frames.
    """
    seen = observed.trust * (start.seen > 0) > 0
    basis = observed.basis(observed.normals)[seen]
    values = srgb_to_linear(observed.colours[seen] / 255).astype(np.float64)
    return light_equations(basis, values, observed.trust[seen], start.albedo[seen], start.light)


def fitted_light(evidence: Sequence[LightEvidence], start: np.ndarray) -> np.ndarray:
    """Light (9, 3) that explains all frames best; `start` (9, 3) where they do not tell.

    Args:
        evidence: of all chunks.
        start: light of the first frames.
    """
    matrix = np.concatenate([part.matrix for part in evidence]).sum(axis=0)
    right = np.concatenate([part.right for part in evidence]).sum(axis=0)
    light = start.copy()
    for c in range(3):
        ridge = _RIDGE * np.trace(matrix[c]) / 9 * np.eye(9)
        if np.trace(matrix[c]) > 0:
            light[:, c] = np.linalg.solve(matrix[c] + ridge, right[c] + ridge @ start[:, c])
    return light
