"""How much each lip holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import boundary_edges


@dataclass(frozen=True)
class LipVolumes:
    """Closed surfaces of the two lips: each lip's skin with a fan over its rim.

    Attributes:
        upper, lower: (n, 3), (m, 3) triangles of each lip.
        upper_rim, lower_rim: (b, 2) directed edges where each ends.
    """

    upper: np.ndarray
    lower: np.ndarray
    upper_rim: np.ndarray
    lower_rim: np.ndarray

    @classmethod
    def of(cls, face: FaceModel) -> LipVolumes:
        """Lips of a face model: the vermilion and a little of the lips' inside."""
        sides = lip_sides(face, with_inside=True)[face.triangles]
        upper, lower = (face.triangles[(sides == side).all(axis=1)] for side in (1, -1))
        return cls(upper, lower, boundary_edges(upper), boundary_edges(lower))

    def measure(self, vertices_mm: np.ndarray) -> np.ndarray:
        """Volumes (F, 2) mm3 of the upper and the lower lip of meshes vertices_mm (F, V, 3).

        Between each lip's skin and the fan from the middle of its rim.
        """
        return np.stack(
            [
                _closed_volume(vertices_mm, self.upper, self.upper_rim),
                _closed_volume(vertices_mm, self.lower, self.lower_rim),
            ],
            axis=1,
        )


def _closed_volume(vertices: np.ndarray, triangles: np.ndarray, rim: np.ndarray) -> np.ndarray:
    middle = vertices[:, rim[:, 0]].mean(axis=1, keepdims=True)
    a, b, c = (vertices[:, triangles[:, k]] - middle for k in range(3))
    # Seen from the middle of the rim, the fan itself has no volume.
    return np.einsum("ftk,ftk->f", a, np.cross(b, c)) / 6.0
