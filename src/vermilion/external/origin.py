"""What a sequence looked like in its file: unit, up axis and polygons, so that results go back there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.geometry.polygons import Polygons
from vermilion.storage.arrays import read_arrays, write_arrays


@dataclass(frozen=True)
class Origin:
    """Of one sequence.

    Attributes:
        unit_mm: length of the file's unit.
        up: axis of the file that points up, `y` or `z`.
        turned: whether the sequence was turned from z up to y up.
        polygons: as the file has them.
        first: a frame that the file has.
    """

    unit_mm: float
    up: str
    turned: bool
    polygons: Polygons
    first: int

    def in_file(self, vertices_mm: np.ndarray) -> np.ndarray:
        """Points `vertices_mm` (..., 3) of the tracker's world, y up, in the file's frame and unit."""
        points = np.asarray(vertices_mm, dtype=np.float64)
        return points @ self.axes.T / self.unit_mm

    def upright(self, points_mm: np.ndarray) -> np.ndarray:
        """The `points_mm` (..., 3) in the file's axes, as the sequence was read: y up where it was turned."""
        return np.asarray(points_mm, dtype=np.float64) @ self.axes

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) turn from the sequence's axes to the file's."""
        if not self.turned:
            return np.eye(3)
        return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(
            path, unit_mm=np.array(self.unit_mm), up=np.array(self.up), turned=np.array(self.turned),
            counts=self.polygons.counts, corners=self.polygons.corners, first=np.array(self.first),
        )  # fmt: skip

    @classmethod
    def load(cls, path: str | Path) -> Origin:
        """Read what `save` wrote."""
        names = ("unit_mm", "up", "turned", "counts", "corners", "first")
        found = read_arrays(path, "what was understood of a sequence", names)
        polygons = Polygons(found["counts"], found["corners"])
        return cls(
            float(found["unit_mm"]), str(found["up"]), bool(found["turned"]), polygons,
            int(found["first"]),
        )  # fmt: skip
