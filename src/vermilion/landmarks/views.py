"""Landmarks of one moment in all cameras of a rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.scheme import N_LANDMARKS
from vermilion.storage.arrays import read_arrays, write_arrays


@dataclass(frozen=True)
class LandmarkViews:
    """Landmarks of the cameras in which a face was found.

    Attributes:
        cameras: (n,) str.
        points_px: (n, 66, 2).
        confidence: (n, 66) in [0, 1].
    """

    cameras: np.ndarray
    points_px: np.ndarray
    confidence: np.ndarray

    @classmethod
    def of(cls, found: Mapping[str, Landmarks]) -> LandmarkViews:
        """Cameras without a face are left out."""
        names = [name for name, entry in found.items() if entry.found]
        return cls(
            np.array(names, dtype=str),
            np.array([found[n].points_px for n in names]).reshape(-1, N_LANDMARKS, 2),
            np.array([found[n].confidence for n in names]).reshape(-1, N_LANDMARKS),
        )

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> LandmarkViews:
        """Read what `save` wrote."""
        return cls(**read_arrays(path, "file of landmark views", cls.__dataclass_fields__))
