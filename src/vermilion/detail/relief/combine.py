"""Positions and normals combined by linear least squares (Nehab et al. 2005)."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.sparse import CholeskyFactor

_BORDER_WEIGHT = 100.0


def combine_positions_and_normals(
    skin_mm: np.ndarray,
    smooth: np.ndarray,
    wanted: np.ndarray,
    topology: FineTopology,
    position_weight: float,
    along_mm: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Displacements (S,) mm along the smooth normals that give the skin the wanted normals.

    Nehab et al. 2005, eq. 7: edges perpendicular to the normals, positions near given ones. Here
    positions move only along the smooth normal. Chords of a curved surface are not perpendicular to
    its normals, so an edge keeps the angle that it has in the smooth mesh: unchanged normals give no
    displacement. The skin's border does not move.

    Args:
        skin_mm: (S, 3) smooth skin.
        smooth: (S, 3) its unit normals.
        wanted: (S, 3) unit normals of the result.
        topology: of the skin.
        position_weight: of the given positions, 1 / mm.
        along_mm: (S,) displacements of the given positions.
    """
    n = len(skin_mm)
    i, j = topology.edges.T
    edge = skin_mm[j] - skin_mm[i]
    length = np.maximum(np.linalg.norm(edge, axis=1), 1e-6)
    new, old = 0.5 * (wanted[i] + wanted[j]), 0.5 * (smooth[i] + smooth[j])
    right = -((new - old) * edge).sum(axis=1) / length
    at_i = -(new * smooth[i]).sum(axis=1) / length
    at_j = (new * smooth[j]).sum(axis=1) / length
    rows = np.arange(len(i))
    slopes = sparse.csr_matrix(
        (
            np.concatenate([at_i, at_j]),
            (np.concatenate([rows, rows]), np.concatenate([i, j])),
        ),
        shape=(len(i), n),
    )
    stay = np.where(topology.border, _BORDER_WEIGHT, position_weight) ** 2
    system = slopes.T @ slopes + sparse.diags(stay)
    near = np.where(topology.border, 0.0, along_mm)
    return CholeskyFactor(system).solve(slopes.T @ right + stay * near)
