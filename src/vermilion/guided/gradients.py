"""Deformation gradients of chosen triangles against the neutral (Guided18 section 4).

`geometry.deformation_gradients` is the definition; here the inverse of the neutral's frames is made once, and
sequences go through a compiled loop. A test holds the two together.
"""

from __future__ import annotations

import numpy as np

from vermilion.geometry.deformation_gradients import inverse_3x3, triangle_frames
from vermilion.storage.kernels import kernel


class NeutralTriangles:
    """Triangles of a neutral, ready for the gradients of any mesh of the topology.

    Attributes:
        triangles: (n, 3) vertex ids of the chosen triangles.
        inverse: (n, 3, 3), D_r^-1, the inverse of each neutral triangle's frame.
    """

    def __init__(self, neutral_mm: np.ndarray, triangles: np.ndarray):
        """neutral_mm: (V, 3); triangles: (n, 3)."""
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        frames = triangle_frames(np.asarray(neutral_mm, np.float64), self.triangles)
        self.inverse = np.ascontiguousarray(inverse_3x3(frames))

    def __len__(self) -> int:
        return len(self.triangles)

    def gradients(self, vertices_mm: np.ndarray) -> np.ndarray:
        """F = D_d D_r^-1 of each triangle, row by row: (F, n * 9) of meshes vertices_mm (F, V, 3).

        The identity where the neutral triangle has no area.
        """
        vertices = np.ascontiguousarray(vertices_mm, dtype=np.float64)
        result = np.empty((len(vertices), len(self.triangles), 3, 3))
        for mesh, values in zip(vertices, result, strict=True):
            _gradients(mesh, self.triangles, self.inverse, values)
        return result.reshape(len(vertices), -1)


@kernel(nogil=True)
def _gradients(vertices, triangles, inverse, result):
    """result[t] = [v2 - v1, v3 - v1, n / sqrt|n|] inverse[t]."""
    frame = np.empty((3, 3))
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for k in range(3):
            frame[k, 0] = vertices[b, k] - vertices[a, k]
            frame[k, 1] = vertices[c, k] - vertices[a, k]
        nx = frame[1, 0] * frame[2, 1] - frame[2, 0] * frame[1, 1]
        ny = frame[2, 0] * frame[0, 1] - frame[0, 0] * frame[2, 1]
        nz = frame[0, 0] * frame[1, 1] - frame[1, 0] * frame[0, 1]
        length = np.sqrt(np.sqrt(nx * nx + ny * ny + nz * nz))
        scale = 1.0 / length if length > 0 else 0.0
        frame[0, 2], frame[1, 2], frame[2, 2] = nx * scale, ny * scale, nz * scale
        for i in range(3):
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total += frame[i, k] * inverse[t, k, j]
                result[t, i, j] = total
        if np.isnan(inverse[t, 0, 0]):
            for i in range(3):
                for j in range(3):
                    result[t, i, j] = 1.0 if i == j else 0.0
