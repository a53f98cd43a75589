"""What every landmark detector gives, and how a take's landmarks are kept in a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from vermilion.landmarks.scheme import N_LANDMARKS
from vermilion.storage.arrays import read_arrays, write_arrays


@dataclass(frozen=True)
class Landmarks:
    """The landmarks of one face in one image.

    Attributes:
        points_px: (66, 2) float64; the centre of the top-left pixel is (0.5, 0.5).
        confidence: (66,) float64 in [0, 1].
        found: whether a face was found; if not, the points are NaN and the confidence zero.
    """

    points_px: np.ndarray
    confidence: np.ndarray
    found: bool

    @classmethod
    def none(cls) -> Landmarks:
        """No face."""
        return cls(np.full((N_LANDMARKS, 2), np.nan), np.zeros(N_LANDMARKS), False)


class LandmarkDetector(Protocol):
    """Finds the landmarks of the most prominent face, each image by itself."""

    def detect(self, linear_rgb: np.ndarray) -> Landmarks:
        """Landmarks of an image (h, w, 3), float32, linear RGB."""


@dataclass(frozen=True)
class LandmarkTrack:
    """Landmarks of the frames of a take, or of some of them.

    Attributes:
        frames: (F,) int frame numbers.
        points_px: (F, 66, 2); NaN where a frame is not valid.
        confidence: (F, 66) in [0, 1].
        valid: (F,) bool.
    """

    frames: np.ndarray
    points_px: np.ndarray
    confidence: np.ndarray
    valid: np.ndarray

    @classmethod
    def of(cls, frames: Sequence[int], found: Sequence[Landmarks]) -> LandmarkTrack:
        """One entry a frame."""
        return cls(
            np.asarray(frames, dtype=np.int64),
            np.stack([entry.points_px for entry in found]),
            np.stack([entry.confidence for entry in found]),
            np.array([entry.found for entry in found], dtype=bool),
        )

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(
            path,
            frames=self.frames,
            points_px=self.points_px,
            confidence=self.confidence,
            valid=self.valid,
        )

    @classmethod
    def load(cls, paths: str | Path | Sequence[str | Path]) -> LandmarkTrack:
        """Read one file, or join several in order of frame."""
        paths = [paths] if isinstance(paths, str | Path) else list(paths)
        parts = [_read_arrays(path) for path in paths]
        joined = {
            key: np.concatenate([part[key] for part in parts])
            for key in ("frames", "points_px", "confidence", "valid")
        }
        order = np.argsort(joined["frames"], kind="stable")
        return cls(**{key: value[order] for key, value in joined.items()})


def _read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    return read_arrays(path, "landmark file", ("frames", "points_px", "confidence", "valid"))
