"""Deform a mesh by data with a thin-plate prior: one sparse factor, conjugate gradients.

Minimises over displacements d (V, 3), in mm,

    sum_i  a_i (d_i^T A_i d_i - 2 b_i^T d_i)  +  l^4  integral |Laplace d - m|^2

with a_i the area of a vertex: `l` is a length (mm), the scale below which the data cannot bend the
mesh, independent of how finely it is meshed. `m` is zero, or what makes the deformed mesh keep the
shape that it has at rest, turned as each neighbourhood turns (Sorkine et al. 2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.geometry.mesh import adjacency
from vermilion.geometry.rotations import nearest_rotation
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian


@dataclass(frozen=True)
class ThinPlate:
    """Bending operator of a mesh at rest.

    Attributes:
        rest_mm: (V, 3).
        adjacency: (V, V) 1 between neighbours.
        laplacian: (V, V) cotangent Laplacian, positive semi-definite.
        bending: (V, V) L M^-1 L.
        areas_mm2: (V,) vertex areas.
    """

    rest_mm: np.ndarray
    adjacency: sparse.csr_matrix
    laplacian: sparse.csr_matrix
    bending: sparse.csr_matrix
    areas_mm2: np.ndarray

    @classmethod
    def of(cls, vertices_mm: np.ndarray, triangles: np.ndarray) -> ThinPlate:
        """Of a mesh at rest, vertices_mm (V, 3) and triangles (T, 3)."""
        laplacian, mass = cotangent_laplacian(vertices_mm, triangles)
        areas = mass.diagonal()
        areas = np.maximum(areas, 0.05 * np.median(areas))
        bending = laplacian @ sparse.diags(1.0 / areas) @ laplacian
        near = adjacency(triangles, len(vertices_mm))
        return cls(np.asarray(vertices_mm), near, laplacian.tocsr(), bending.tocsr(), areas)

    def rotations(self, vertices_mm: np.ndarray, smoothing: int = 3) -> np.ndarray:
        """Rotations (V, 3, 3) of neighbourhoods from rest to vertices_mm (V, 3), mean of some rings."""
        rows, columns = self.adjacency.nonzero()
        before = self.rest_mm[columns] - self.rest_mm[rows]
        after = vertices_mm[columns] - vertices_mm[rows]
        outer = (after[:, :, None] * before[:, None, :]).reshape(len(rows), 9)
        n = len(vertices_mm)
        sums = sparse.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows))))) @ outer
        mix = self.adjacency + sparse.eye(n)
        for _ in range(smoothing):
            sums = mix @ sums
        return nearest_rotation(sums.reshape(n, 3, 3))

    def missing(self, vertices_mm: np.ndarray) -> np.ndarray:
        """Laplacian (V, 3) that the rest shape, turned locally, has and vertices_mm (V, 3) lack."""
        wanted = np.einsum("vij,vj->vi", self.rotations(vertices_mm), self.laplacian @ self.rest_mm)
        return wanted - self.laplacian @ vertices_mm


class DisplacementSolver:
    """Solves the energy above; one factor preconditions a series of similar systems.

    The factor is of the system with each A_i replaced by a third of its trace, so that x, y and z
    separate; conjugate gradients bring in the rest.
    """

    def __init__(
        self,
        plate: ThinPlate,
        blocks: np.ndarray,
        length_mm: float,
        *,
        anchor: float = 1e-6,
        tolerance: float = 1e-4,
        max_iterations: int = 150,
    ):
        """Factor for data of about `blocks` (V, 3, 3) (dimensionless) and stiffness `length_mm`.

        `anchor` pulls every vertex a little towards d = 0, so that parts without data stay.
        """
        self.plate, self.anchor = plate, anchor
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.stiffness = float(length_mm) ** 4
        diagonal = plate.areas_mm2 * (np.einsum("vii->v", blocks) / 3.0 + anchor)
        self._factor = CholeskyFactor(self.stiffness * plate.bending + sparse.diags(diagonal))

    def solve(
        self,
        blocks: np.ndarray,
        right: np.ndarray,
        wanted_laplacian: np.ndarray | None = None,
        start_mm: np.ndarray | None = None,
    ) -> np.ndarray:
        """Displacements (V, 3) mm.

        Args:
            blocks: (V, 3, 3) A_i, symmetric positive semi-definite (dimensionless).
            right: (V, 3) b_i, mm.
            wanted_laplacian: (V, 3) what L d should be (see `ThinPlate.missing`); zero by default.
            start_mm: (V, 3) where the iteration starts.
        """
        areas = self.plate.areas_mm2[:, None]
        scaled = areas[:, :, None] * (blocks + self.anchor * np.eye(3))
        target = areas * right
        if wanted_laplacian is not None:
            bend = self.plate.laplacian @ (wanted_laplacian / areas)
            target = target + self.stiffness * bend

        def apply(x: np.ndarray) -> np.ndarray:
            return self.stiffness * (self.plate.bending @ x) + (scaled @ x[:, :, None])[:, :, 0]

        goal = self.tolerance * np.linalg.norm(target)
        solution = np.zeros_like(target) if start_mm is None else start_mm.copy()
        residual = target if start_mm is None else target - apply(start_mm)
        direction, old = np.zeros_like(target), 1.0
        for step in range(self.max_iterations):
            if np.linalg.norm(residual) <= goal:
                break
            conditioned = self._factor.solve(residual)
            new = float(np.vdot(residual, conditioned))
            direction = conditioned + (new / old if step else 0.0) * direction
            applied = apply(direction)
            along = new / float(np.vdot(direction, applied))
            solution += along * direction
            residual = residual - along * applied
            old = new
        return solution


def solve_displacement(
    plate: ThinPlate,
    blocks: np.ndarray,
    right: np.ndarray,
    length_mm: float,
    wanted_laplacian: np.ndarray | None = None,
) -> np.ndarray:
    """One call of `DisplacementSolver`.

    Args:
        plate: the prior, V vertices.
        blocks: (V, 3, 3), dimensionless.
        right: (V, 3) mm.
        length_mm: stiffness.
        wanted_laplacian: (V, 3), see `DisplacementSolver.solve`.

    Returns:
        (V, 3) displacements, mm.
    """
    return DisplacementSolver(plate, blocks, length_mm).solve(blocks, right, wanted_laplacian)
