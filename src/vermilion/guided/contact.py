"""Lips never pass through each other: beyond Guided18, whose section 7 names it as future work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.correction.lip_constraints import SLACK_MM, separation_constraints
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.guided.constrained_energy import ConstrainedEnergy

_ROUNDS = 8


@dataclass(frozen=True)
class SeparatedLips:
    """A mesh whose lips were separated.

    Attributes:
        vertices_mm: (V, 3).
        depth_mm: how deep one lip still lies in the other.
    """

    vertices_mm: np.ndarray
    depth_mm: float


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
    return SeparatedLips(best[1], best[0])
