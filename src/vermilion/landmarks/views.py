"""Landmarks of one moment in all cameras of a rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.errors import InputError
from vermilion.files import atomic_path
from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.scheme import N_LANDMARKS


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
        with atomic_path(path) as temporary, open(temporary, "wb") as stream:
            np.savez(
                stream,
                cameras=self.cameras,
                points_px=self.points_px,
                confidence=self.confidence,
            )

    @classmethod
    def load(cls, path: str | Path) -> LandmarkViews:
        """Read what `save` wrote."""
        try:
            with np.load(path, allow_pickle=False) as data:
                return cls(data["cameras"], data["points_px"], data["confidence"])
        except (OSError, ValueError, KeyError, EOFError) as error:
            raise InputError(
                f"an unreadable file of landmark views ({error})",
                "a .npz with cameras, points_px, confidence",
                "Remove the file and run again.",
                path=path,
            ) from error
