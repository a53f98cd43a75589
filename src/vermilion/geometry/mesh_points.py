"""Points that are fixed combinations of a mesh's vertices: places on its edges and triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MeshPoints:
    """N points, each of k vertices.

    Attributes:
        vertices: (N, k) vertex ids.
        weights: (N, k), their shares in each point.
    """

    vertices: np.ndarray
    weights: np.ndarray

    def __len__(self) -> int:
        return len(self.vertices)

    def __getitem__(self, rows: np.ndarray | slice) -> MeshPoints:
        return MeshPoints(self.vertices[rows], self.weights[rows])

    @classmethod
    def on_edges(cls, start: np.ndarray, end: np.ndarray, fraction: np.ndarray) -> MeshPoints:
        """At a `fraction` (N,) of the way from vertex `start` (N,) to vertex `end` (N,)."""
        return cls(np.stack([start, end], axis=1), np.stack([1 - fraction, fraction], axis=1))

    def of(self, field: np.ndarray) -> np.ndarray:
        """Values at the points, (..., N, d), of values at the vertices, (..., V, d)."""
        return (field[..., self.vertices, :] * self.weights[..., None]).sum(axis=-2)
