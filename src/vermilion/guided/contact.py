"""Lips never pass through each other, and how much each holds: contact and volume of the lips.

Beyond Guided18, whose section 7 names both as future work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.correction.lip_constraints import SLACK_MM, separation_constraints
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import boundary_edges
from vermilion.guided.constrained_energy import ConstrainedEnergy

_ROUNDS = 8


@dataclass(frozen=True)
class SeparatedLips:
    """A mesh whose lips were separated.

    Attributes:
        vertices_mm: (V, 3).
        before_mm, after_mm: how deep one lip lay in the other, before and after.
    """

    vertices_mm: np.ndarray
    before_mm: float
    after_mm: float


def separate_lips(
    vertices_mm: np.ndarray,
    crossings: LipCrossings,
    energy: ConstrainedEnergy,
    rounds: int = _ROUNDS,
) -> SeparatedLips:
    """Move the energy's free vertices as little as it allows, so that no lip lies in the other.

    One-sided constraints at the edges that enter the other lip (`separation_constraints`), found
    again after each solve; those of earlier rounds stay, so that a vertex does not go back.

    Args:
        vertices_mm: (V, 3), any frame.
        crossings: finds where the lips cross.
        energy: of displacements, mm.
        rounds: of solving.
    """
    start = np.asarray(vertices_mm, dtype=np.float64)
    constraints, before = separation_constraints(crossings, start, start)
    current, after, best = start, before, (before, start)
    for _ in range(rounds):
        if after <= SLACK_MM:
            break
        current = start.copy()
        current[energy.free] += energy.minimise(constraints)
        more, after = separation_constraints(crossings, start, current)
        best = min(best, (after, current), key=lambda pair: pair[0])
        constraints = constraints + more
    return SeparatedLips(best[1], before, best[0])


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
