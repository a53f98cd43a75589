"""Linear constraints on few vertices beside a factored quadratic energy (Woodbury).

With the energy x^T A x over displacements x of the free vertices (the same A for the three
coordinates) and rows  d_i . sum_a c_ia x_(v_ia) = r_i  of compliance s_i (the inverse of a weight),
the minimum is

    x = A^-1 J^T l,      (J A^-1 J^T + diag(s)) l = r.

Columns of A^-1 are made when a row first names their vertex and kept: the factor of A serves every
frame of a topology, whatever its constraints.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from vermilion.correction.constraints import Rows
from vermilion.geometry.sparse import CholeskyFactor

_ROUNDS = 12
#: Keeps the system definite where exact rows repeat each other.
_LEAST_COMPLIANCE = 1e-9


class RowSolver:
    """Solves for displacements under rows; `free` (N,) are the vertices that may move."""

    def __init__(self, factor: CholeskyFactor, free: np.ndarray, n_vertices: int):
        self.free = free
        self._factor = factor
        self._row = np.full(n_vertices, -1)
        self._row[free] = np.arange(len(free))
        self._place = np.full(n_vertices, -1)
        self._columns = np.zeros((0, len(free)))

    def solve(self, rows: Rows) -> np.ndarray:
        """Displacements (N, 3) mm of the free vertices; vertices that are not free stay."""
        if len(rows) == 0:
            return np.zeros((len(self.free), 3))
        self._make_columns(np.unique(rows.vertices))
        shares = self._shares(rows)
        inverse = self._columns[:, self._row[self._named]]
        system = (shares @ (shares @ inverse).T) * (rows.directions @ rows.directions.T)
        system[np.diag_indices(len(rows))] += rows.compliance + _LEAST_COMPLIANCE
        strength = _multipliers(system, rows.wanted, rows.one_sided)
        force = shares.T @ (strength[:, None] * rows.directions)
        return self._columns.T @ force

    def _make_columns(self, vertices: np.ndarray) -> None:
        new = vertices[(self._row[vertices] >= 0) & (self._place[vertices] < 0)]
        if len(new):
            units = np.zeros((len(self.free), len(new)))
            units[self._row[new], np.arange(len(new))] = 1.0
            self._place[new] = len(self._columns) + np.arange(len(new))
            self._columns = np.concatenate([self._columns, self._factor.solve(units).T])
        self._named = np.empty(len(self._columns), dtype=np.int64)
        known = np.flatnonzero(self._place >= 0)
        self._named[self._place[known]] = known

    def _shares(self, rows: Rows) -> sparse.csr_matrix:
        """(m, K): each row's coefficients at the vertices that have a column."""
        count, width = rows.vertices.shape
        place = self._place[rows.vertices]
        held = place < 0
        parts = (
            np.where(held, 0.0, rows.coefficients).ravel(),
            (np.repeat(np.arange(count), width), np.where(held, 0, place).ravel()),
        )
        return sparse.csr_matrix(parts, shape=(count, len(self._columns)))


def _multipliers(system: np.ndarray, wanted: np.ndarray, one_sided: np.ndarray) -> np.ndarray:
    """Forces (m,) along the rows; none where a one-sided row would have to pull back."""
    result = np.zeros(len(wanted))
    active = np.ones(len(wanted), dtype=bool)
    for _ in range(_ROUNDS):
        result[:] = 0.0
        part = system[np.ix_(active, active)] if not active.all() else system
        result[active] = linalg.solve(part, wanted[active], assume_a="pos")
        pulling = active & one_sided & (result < 0)
        if not pulling.any():
            break
        active &= ~pulling
    return np.where(one_sided, np.maximum(result, 0.0), result)
