"""From a correction layer to vertices: deformation transfer (Sumner and Popovic 2004).

With G_t the gradient of the layer at triangle t and c the coarse mesh of the frame, the corrected
mesh x minimises, over the free vertices of the domain,

    sum_t sum_(ij in t) w_ij |(x_i - x_j) - G_t (c_i - c_j)|^2  +  sum_i h_i |x_i - c_i|^2
                                                       +  sum_i a_i / l^2 |x_i - c_i - p_i|^2

with cotangent weights w of the neutral, G_t = I outside the mask, and x = c at fixed vertices. For
the displacement d = x - c only mask triangles have a right-hand side, (G_t - I)(c_i - c_j), and the
matrix depends on the neutral alone: it is factored once a topology and person, and all coordinates
of a block of frames are solved together. Cotangents are kept positive, so that the matrix is
definite on any mesh; weights do not matter where a mesh with these gradients exists: it is returned.

The last term is ours (`detail_mm` l > 0): gradients say nothing of where the mesh lies, and its border
stays where the tracker put it. With displacements p_i of the mask's vertices and their areas a_i, detail
finer than l comes from the layers, and places over longer ranges from p.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from vermilion.correction.domain import integration_domain
from vermilion.correction.right_side import (
    LANES,
    TURN_SERIES,
    accumulate,
    accumulate_mixture,
    add_frames,
    add_places,
    gather,
    turn_limits,
)
from vermilion.geometry.cotangents import cotangents, edge_stiffness
from vermilion.geometry.mesh import mesh_corners, vertex_areas
from vermilion.geometry.sparse import CholeskyFactor


class LayerIntegrator:
    """Integrates correction layers over one topology and neutral; factors on construction.

    Args:
        neutral_mm: (V, 3) of the person, head frame.
        triangles: (T, 3).
        mask: (M,) triangle ids of the layer.
        seam_mm: width of the soft ring outside the mask.
        detail_mm: detail finer than this comes from layers, the rest from displacements; 0: layers alone.

    Attributes:
        mask: (M,) triangle ids of the layer.
        free: (N,) ids of the vertices that may move.
        matrix: (N, N) of the system.
        factor: its Cholesky factor.
        weights: (M, 3) of the edges 12, 20, 01 of each mask triangle.
        places: (N',) which of the mask's corners, ascending, have a place: those that may move.
        place_weight: (N',) a / l^2 of each; none without `detail_mm`.
    """

    def __init__(
        self,
        neutral_mm: np.ndarray,
        triangles: np.ndarray,
        mask: np.ndarray,
        seam_mm: float = 16.0,
        detail_mm: float = 0.0,
    ):
        neutral_mm = np.asarray(neutral_mm, dtype=np.float64)
        domain = integration_domain(neutral_mm, triangles, mask, seam_mm)
        self.mask = np.asarray(mask, dtype=np.int64)
        self.free = domain.free
        inside = triangles[self.mask]
        weights = cotangents(neutral_mm, inside)
        kept_weights = cotangents(neutral_mm, domain.kept) * domain.kept_weight[:, None]
        stiffness = edge_stiffness(
            np.concatenate([inside, domain.kept]),
            np.concatenate([weights, kept_weights]),
            len(neutral_mm),
        )
        hold = sparse.diags_array(domain.hold * stiffness.diagonal()[self.free])
        # The kernel sees only the corners of mask triangles; fixed ones go to a waste row.
        self._local = mesh_corners(triangles, self.mask)
        position = np.full(len(neutral_mm), len(self.free))
        position[self.free] = np.arange(len(self.free))
        self._row = position[self._local].astype(np.int32)
        placed = self._row < len(self.free) if detail_mm > 0 else np.zeros(len(self._row), bool)
        self.places = np.flatnonzero(placed)
        areas = vertex_areas(neutral_mm, triangles)[self._local[self.places]]
        self.place_weight = areas / detail_mm**2 if detail_mm > 0 else areas
        diagonal = np.zeros(len(self.free))
        diagonal[self._row[self.places]] = self.place_weight
        hold = hold + sparse.diags_array(diagonal)
        self.matrix = sparse.csc_matrix(stiffness[self.free][:, self.free] + hold)
        self.factor = CholeskyFactor(self.matrix)
        self._corners = np.searchsorted(self._local, inside).astype(np.int32)
        self.weights = weights

    def integrate(
        self, coarse: np.ndarray, layers: np.ndarray, displacement_mm: np.ndarray | None = None
    ) -> np.ndarray:
        """Corrected vertices, (F, V, 3) float64, by given layers: in double precision throughout.

        Args:
            coarse: (F, V, 3), in the layers' frame (the canonical head frame).
            layers: (F, M, 9).
            displacement_mm: (F, N, 3) of the mask's corners, ascending; needed with `detail_mm`.
        """
        if layers.shape != (len(coarse), len(self.mask), 9):
            raise ValueError(
                f"layers must be ({len(coarse)}, {len(self.mask)}, 9), got {layers.shape}"
            )
        moved = np.asarray(displacement_mm)
        if len(self.places) and moved.shape != (len(coarse), len(self._local), 3):
            raise ValueError(
                f"displacement_mm must be ({len(coarse)}, {len(self._local)}, 3) with detail_mm, "
                f"got {moved.shape}"
            )
        frames_last = np.zeros((len(self.mask), 9, LANES))

        def add_to(right: np.ndarray, points: np.ndarray, part: slice) -> None:
            given = layers[part]
            frames_last[..., : len(given)] = np.transpose(given, (1, 2, 0))
            accumulate(*self._triangles(points), frames_last, *_series(points.dtype), right)
            if len(self.places):
                wanted = np.transpose(moved[part][:, self.places], (1, 2, 0))
                rows = self._row[self.places]
                right[rows, :, : len(given)] += self.place_weight[:, None, None] * wanted

        return self._corrected(coarse, add_to, np.dtype(np.float64))

    def integrate_mixture(
        self,
        coarse: np.ndarray,
        mixture: np.ndarray,
        basis: np.ndarray,
        place_basis: np.ndarray | None = None,
    ) -> np.ndarray:
        """Corrected vertices, (F, V, 3) float64, by the layers `mixture @ basis.T`.

        The layers are never all in memory, and right-hand sides are made in the precision of the
        basis: in single precision the vertices are good to 1e-4 mm.

        Args:
            coarse: (F, V, 3), in the canonical head frame.
            mixture: (F, R).
            basis: (M * 9, R), contiguous.
            place_basis: (N' * 3, R) of `weighted_places`, contiguous; needed with `detail_mm`.
        """
        lanes = np.zeros((basis.shape[1], LANES), dtype=basis.dtype)

        def add_to(right: np.ndarray, points: np.ndarray, part: slice) -> None:
            given = mixture[part]
            lanes[:, : len(given)] = given.T
            accumulate_mixture(*self._triangles(points), basis, lanes, *_series(basis.dtype), right)
            if len(self.places):
                add_places(self._row[self.places], place_basis, lanes, right)

        return self._corrected(coarse, add_to, basis.dtype)

    def weighted_places(self, displacements_mm: np.ndarray) -> np.ndarray:
        """(N' * 3, R) of `displacements_mm` (R, N * 3) of the mask's corners, as the system weighs them."""
        chosen = displacements_mm.reshape(len(displacements_mm), -1, 3)[:, self.places]
        weighted = chosen * self.place_weight[:, None]
        return np.ascontiguousarray(weighted.reshape(len(chosen), -1).T, dtype=np.float32)

    def _triangles(self, points: np.ndarray) -> tuple[np.ndarray, ...]:
        return self._corners, self._row, self.weights.astype(points.dtype, copy=False), points

    def _corrected(
        self,
        coarse: np.ndarray,
        add_to: Callable[[np.ndarray, np.ndarray, slice], None],
        precision: np.dtype,
    ) -> np.ndarray:
        """Solve for the frames in blocks of LANES; which frames share a block changes no result."""
        corrected = np.array(coarse, dtype=np.float64)
        points = np.empty((len(self._local), 3, LANES), dtype=precision)
        right = np.empty((len(self.free) + 1, 3, LANES))
        for first in range(0, len(corrected), LANES):
            block = corrected[first : first + LANES]
            gather(block, self._local, points)
            right[:] = 0.0
            add_to(right, points, slice(first, first + LANES))
            add_frames(block, self.free, self.factor.solve(right[:-1, :, : len(block)]))
        return corrected


def _series(precision: np.dtype) -> tuple[np.ndarray, np.ndarray]:
    return TURN_SERIES[np.dtype(precision)], turn_limits(precision)
