"""Soft linear constraints on few vertices of an integrated mesh, by a low-rank update (Woodbury).

The energy about the integration's solution x0 is (x - x0)^T A (x - x0), the same A for all three
coordinates: that of the integration, and what is added to it. With rows  d_i . sum_a c_ia (x - x0)_(v_ia) = r_i  of compliance s_i (the inverse of a
weight beside the mesh's stiffness), the minimum is

    x = x0 + A^-1 J^T l,      (S + diag(s)) l = r,      S_ij = (d_i . d_j) sum_ab c_ia G_(v_ia, v_jb) c_jb

and G, the block of A^-1 at the vertices that constraints may name, is made once a topology and person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import sparse

from vermilion.correction.integration import LayerIntegrator
from vermilion.geometry.sparse import CholeskyFactor

_ROUNDS = 10
#: Keeps the system definite where exact constraints repeat each other.
LEAST_COMPLIANCE = 1e-9


@dataclass(frozen=True)
class LinearConstraints:
    """m constraints on a frame's mesh: a weighted sum of vertices has a value along a direction.

    Attributes:
        vertices: (m, k) vertex ids.
        coefficients: (m, k).
        directions: (m, 3) unit vectors, in the mesh's frame.
        target_mm: (m,) along the direction.
        compliance: (m,); 0 is exact.
        one_sided: (m,) bool: met as well where the mesh moves further along the direction.
    """

    vertices: np.ndarray
    coefficients: np.ndarray
    directions: np.ndarray
    target_mm: np.ndarray
    compliance: np.ndarray
    one_sided: np.ndarray

    @classmethod
    def none(cls) -> LinearConstraints:
        """No constraint."""
        empty = np.zeros(0)
        return cls(
            np.zeros((0, 1), dtype=np.int64), np.zeros((0, 1)), np.zeros((0, 3)), empty, empty,
            np.zeros(0, dtype=bool),
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.target_mm)

    def __add__(self, other: LinearConstraints) -> LinearConstraints:
        if len(self) == 0 or len(other) == 0:
            return self if len(self) else other
        width = max(self.vertices.shape[1], other.vertices.shape[1])
        pairs = [(getattr(self._padded(width), f.name), getattr(other._padded(width), f.name))
                 for f in fields(self)]  # fmt: skip
        return LinearConstraints(*(np.concatenate(pair) for pair in pairs))

    def __getitem__(self, chosen: np.ndarray | slice) -> LinearConstraints:
        return LinearConstraints(*(getattr(self, f.name)[chosen] for f in fields(self)))

    def evaluate(self, vertices_mm: np.ndarray) -> np.ndarray:
        """d . sum c v, (m,) mm, of a mesh or displacements `vertices_mm` (V, 3)."""
        points = (vertices_mm[self.vertices] * self.coefficients[..., None]).sum(axis=1)
        return (points * self.directions).sum(axis=1)

    def _padded(self, width: int) -> LinearConstraints:
        spare = width - self.vertices.shape[1]
        if spare == 0:
            return self
        again = np.repeat(self.vertices[:, :1], spare, axis=1)
        vertices = np.concatenate([self.vertices, again], axis=1)
        coefficients = np.pad(self.coefficients, ((0, 0), (0, spare)))
        return replace(self, vertices=vertices, coefficients=coefficients)


class ConstraintSolver:
    """Adds constraints to the solutions of an integrator.

    Args:
        integrator: whose free vertices move, at the cost of its energy.
        vertices: (K,) ids that constraints may name.
        stiffness: (N, N) sparse, of its free vertices: added to its energy; None: the integrator's factor
            serves.
    """

    def __init__(
        self,
        integrator: LayerIntegrator,
        vertices: np.ndarray,
        stiffness: sparse.sparray | None = None,
    ):
        self._integrator = integrator
        self._factor = integrator.factor
        if stiffness is not None:
            self._factor = CholeskyFactor(integrator.matrix + stiffness)
        n_free, n_all = len(integrator.free), int(max(vertices.max(), integrator.free.max())) + 1
        row = np.full(n_all, n_free)
        row[integrator.free] = np.arange(n_free)
        named = np.asarray(vertices)[row[vertices] < n_free]
        self._named_rows = row[named]
        units = np.zeros((n_free, len(named)))
        units[self._named_rows, np.arange(len(named))] = 1.0
        self._place = np.full(n_all, len(named))  # one more for vertices that cannot move
        self._place[named] = np.arange(len(named))
        self._inverse = np.zeros((len(named) + 1, len(named) + 1))
        self._inverse[:-1, :-1] = self._factor.solve(units)[self._named_rows]

    def forces(self, constraints: LinearConstraints) -> np.ndarray:
        """Forces l (m,) along the constraints; 0 where a one-sided one would have to pull back."""
        if len(constraints) == 0:
            return np.zeros(0)
        return one_sided_forces(self.response(constraints, constraints), constraints)

    def response(self, of: LinearConstraints, to: LinearConstraints) -> np.ndarray:
        """(m, m'): what `of` measures when each force of `to` is one."""
        return self.response_of(self.answers(of), of, to)

    def answers(self, of: LinearConstraints) -> np.ndarray:
        """(m, K + 1): how what `of` measures follows the named vertices' pushes, by size alone."""
        return self._shares(of) @ self._inverse

    def response_of(
        self, answers: np.ndarray, of: LinearConstraints, to: LinearConstraints
    ) -> np.ndarray:
        """`response`, with the `answers` (m, K + 1) of `of` made before."""
        return (self._shares(to) @ answers.T).T * (of.directions @ to.directions.T)

    def pushes(self, constraints: LinearConstraints, forces: np.ndarray) -> np.ndarray:
        """(K + 1, 3): pushes at the named vertices by the forces (m,) along constraints; the last one is of the others."""
        return self._shares(constraints).T @ (forces[:, None] * constraints.directions)

    def displacements_at(self, vertices: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Displacements (n, 3) mm of some of the named vertices (n,), by a frame's pushes (K + 1, 3)."""
        return self._inverse[self._place[vertices]] @ pushes

    def displacements(self, pushes: Sequence[np.ndarray]) -> np.ndarray:
        """Displacements (F, N, 3) mm of the integrator's free vertices, by each frame's pushes (K + 1, 3)."""
        right = np.zeros((len(self._integrator.free), 3, len(pushes)))
        for f, of_frame in enumerate(pushes):
            right[self._named_rows, :, f] = of_frame[:-1]
        return np.moveaxis(self._factor.solve(right), 2, 0)

    def _shares(self, constraints: LinearConstraints) -> sparse.csr_matrix:
        """(m, K + 1): each constraint's coefficients at the named vertices."""
        return shares_of_vertices(constraints, self._place, len(self._inverse))


def one_sided_forces(response: np.ndarray, constraints: LinearConstraints) -> np.ndarray:
    """Forces (m,) along constraints; 0 where a one-sided one would have to pull back.

    Args:
        response: (m, m), what each constraint measures when the force of another is one.
        constraints: m.
    """
    system = response + np.diag(constraints.compliance + LEAST_COMPLIANCE)
    result, active = np.zeros(len(constraints)), np.ones(len(constraints), dtype=bool)
    for _ in range(_ROUNDS):
        result[:] = 0.0
        result[active] = np.linalg.solve(
            system[np.ix_(active, active)], constraints.target_mm[active]
        )
        pulling = active & constraints.one_sided & (result < 0)
        if not pulling.any():
            break
        active &= ~pulling
    return np.where(constraints.one_sided, np.maximum(result, 0.0), result)


def shares_of_vertices(
    constraints: LinearConstraints, place: np.ndarray, count: int
) -> sparse.csr_matrix:
    """Each constraint's coefficients at places of vertices, (m, count).

    Args:
        place: (V,) place of each vertex, from 0 to count - 1.
    """
    rows, width = constraints.vertices.shape
    starts = np.arange(0, rows * width + 1, width)
    at = place[constraints.vertices].ravel()
    return sparse.csr_matrix((constraints.coefficients.ravel(), at, starts), shape=(rows, count))
