"""Linear constraints on few vertices beside a factored quadratic energy (Woodbury).

With the energy x^T A x over displacements x of the free vertices (the same A for the three
coordinates) and constraints  d_i . sum_a c_ia x_(v_ia) = r_i  of compliance s_i (the inverse of a
weight), the minimum is

    x = A^-1 J^T l,      (J A^-1 J^T + diag(s)) l = r.

Columns of A^-1 are made when a constraint first names their vertex and kept: the factor of A serves
every frame of a topology, whatever its constraints. `correction.constraints.ConstraintSolver` instead
knows the vertices beforehand and solves many frames together.
"""

from __future__ import annotations

import numpy as np

from vermilion.correction.constraints import (
    LinearConstraints,
    one_sided_forces,
    shares_of_vertices,
)
from vermilion.geometry.sparse import CholeskyFactor


class ConstrainedEnergy:
    """Minimises a factored energy under constraints.

    Attributes:
        free: (N,) ids of the vertices that may move.
    """

    def __init__(self, factor: CholeskyFactor, free: np.ndarray, n_vertices: int):
        """The energy's factor (N, N) over the vertices `free` (N,) of a mesh of V vertices."""
        self.free = free
        self._factor = factor
        self._row = np.full(n_vertices, -1)
        self._row[free] = np.arange(len(free))
        # Vertices without a column, those that cannot move among them, point at the waste place 0.
        self._place = np.zeros(n_vertices, dtype=np.int64)
        self._columns = np.zeros((1, len(free)))

    def minimise(self, constraints: LinearConstraints) -> np.ndarray:
        """Displacements (N, 3) mm of the free vertices; vertices that are not free stay."""
        if len(constraints) == 0:
            return np.zeros((len(self.free), 3))
        self._make_columns(np.unique(constraints.vertices))
        shares = shares_of_vertices(constraints, self._place, len(self._columns))
        named = np.flatnonzero(self._place)
        inverse = np.zeros((len(self._columns), len(self._columns)))
        inverse[:, self._place[named]] = self._columns[:, self._row[named]]
        system = (shares @ (shares @ inverse).T) * (
            constraints.directions @ constraints.directions.T
        )
        forces = one_sided_forces(system, constraints)
        return self._columns.T @ (shares.T @ (forces[:, None] * constraints.directions))

    def _make_columns(self, vertices: np.ndarray) -> None:
        new = vertices[(self._row[vertices] >= 0) & (self._place[vertices] == 0)]
        if len(new):
            units = np.zeros((len(self.free), len(new)))
            units[self._row[new], np.arange(len(new))] = 1.0
            self._place[new] = len(self._columns) + np.arange(len(new))
            self._columns = np.concatenate([self._columns, self._factor.solve(units).T])
