"""A frame that a person corrected, as a file between refinement and training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.storage.arrays import read_arrays, write_arrays


@dataclass(frozen=True)
class RefinedFrame:
    """One corrected frame beside what it was.

    Attributes:
        frame: number of the frame.
        kind: "sketch" or "sculpt".
        vertices_mm: (V, 3) corrected, world.
        base_mm: (V, 3) of the sequence, world.
    """

    frame: int
    kind: str
    vertices_mm: np.ndarray
    base_mm: np.ndarray

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(
            path,
            frame=np.array(self.frame),
            kind=np.array(self.kind),
            vertices_mm=self.vertices_mm,
            base_mm=self.base_mm,
        )

    @classmethod
    def load(cls, path: str | Path) -> RefinedFrame:
        """Read what `save` wrote."""
        names = ("frame", "kind", "vertices_mm", "base_mm")
        arrays = read_arrays(path, "refined frame", names)
        return cls(
            int(arrays["frame"]), str(arrays["kind"]), arrays["vertices_mm"], arrays["base_mm"]
        )


def stacked(frames: Sequence[RefinedFrame]) -> tuple[np.ndarray, np.ndarray]:
    """(corrected, base) meshes of k frames, (k, V, 3) each, world, mm."""
    return (
        np.stack([frame.vertices_mm for frame in frames]),
        np.stack([frame.base_mm for frame in frames]),
    )
