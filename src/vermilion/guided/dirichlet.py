"""From predicted gradients back to vertices (Guided18 section 4, last paragraph).

Over the free vertices of the inner lips, with the border where the mouth region has it, the mesh
minimises  sum_t sum_(ij in t) w_ij |(x_i - x_j) - F_t (r_i - r_j)|^2  with r the neutral and w its
cotangents, kept positive. The matrix depends on the neutral alone and is factored once. Where a mesh
with these gradients exists, it is returned.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.geometry.cotangents import cotangents, edge_stiffness
from vermilion.geometry.mesh import vertex_areas
from vermilion.geometry.sparse import CholeskyFactor
from vermilion.guided.regions import GuidedRegions

#: What hangs on the lips (the inside of the mouth) follows them and fades over this length.
FOLLOW_MM = 12.0


class GradientIntegrator:
    """Places the inner lips' vertices by their gradients; factors on construction.

    Attributes:
        regions: of the topology.
        factor: Cholesky factor of the system (f, f) over `regions.free`.
    """

    def __init__(
        self, neutral_mm: np.ndarray, regions: GuidedRegions, follow_mm: float = FOLLOW_MM
    ):
        """Factor the system of a neutral (V, 3) mm; `follow_mm`: see `FOLLOW_MM`."""
        neutral = np.asarray(neutral_mm, dtype=np.float64)
        self.regions = regions
        inside = regions.triangles[regions.predicted]
        weights = cotangents(neutral, inside)
        stiffness = edge_stiffness(inside, weights, regions.n_vertices)[regions.free]
        self.factor = CholeskyFactor(stiffness[:, regions.free])
        self._of_border = sparse.csr_matrix(stiffness[:, regions.border])
        self._divergence = gradient_divergence(neutral, inside, weights)[regions.free]
        self._followers = (
            _Followers(neutral, regions, follow_mm) if len(regions.followers) else None
        )

    def integrate(self, gradients: np.ndarray, base_mm: np.ndarray) -> np.ndarray:
        """Meshes with the inner lips placed by their gradients, (F, V, 3) float64.

        Args:
            gradients: (F, 9n), in the frame of `base_mm`.
            base_mm: (F, V, 3); all vertices but the inner lips' free ones and their followers stay
                as they are, to the last bit.
        """
        n_frames, triangles = len(base_mm), len(self.regions.predicted)
        if gradients.shape != (n_frames, 9 * triangles):
            raise ValueError(
                f"gradients must be ({n_frames}, {9 * triangles}), got {gradients.shape}"
            )
        result = np.array(base_mm, dtype=np.float64)
        # Near the mouth, so that far origins cost no digits.
        origin = result[:, self.regions.border].mean(axis=1)
        border = np.moveaxis(result[:, self.regions.border] - origin[:, None], 0, 1)
        # F_t[axis, j] -> rows (t, j), columns (frame, axis)
        rows = gradients.reshape(n_frames, triangles, 3, 3).transpose(1, 3, 0, 2)
        right = self._divergence @ rows.reshape(3 * triangles, -1)
        right -= self._of_border @ border.reshape(len(self.regions.border), -1)
        solved = self.factor.solve(right).reshape(-1, n_frames, 3)
        result[:, self.regions.free] = np.moveaxis(solved, 0, 1) + origin[:, None]
        return self.follow(result, base_mm)

    def follow(self, moved_mm: np.ndarray, base_mm: np.ndarray) -> np.ndarray:
        """Meshes whose followers go along with lips that moved from `base_mm`, (F, V, 3)."""
        if self._followers is not None:
            self._followers.place(moved_mm, base_mm)
        return moved_mm


class _Followers:
    """The part that hangs on the inner lips: (L + M / length^2) d = 0 with d given at the lips."""

    def __init__(self, neutral: np.ndarray, regions: GuidedRegions, length_mm: float):
        """neutral: (V, 3) mm."""
        self.ids = regions.followers
        self.lips = regions.free
        touched = np.zeros(regions.n_vertices, dtype=bool)
        touched[self.ids] = True
        around = regions.triangles[touched[regions.triangles].any(axis=1)]
        stiffness = edge_stiffness(around, cotangents(neutral, around), regions.n_vertices)
        area = vertex_areas(neutral, around)[self.ids] / length_mm**2
        own = stiffness[self.ids]
        self._factor = CholeskyFactor(own[:, self.ids] + sparse.diags_array(area))
        self._of_lips = sparse.csr_matrix(own[:, self.lips])

    def place(self, moved: np.ndarray, base: np.ndarray) -> None:
        """Place the followers in `moved` (F, V, 3) by where the lips were in `base` (F, V, 3), mm."""
        along = np.moveaxis(moved[:, self.lips] - base[:, self.lips], 0, 1)
        right = -self._of_lips @ along.reshape(len(self.lips), -1)
        shift = self._factor.solve(right).reshape(-1, len(moved), 3)
        moved[:, self.ids] = base[:, self.ids] + np.moveaxis(shift, 0, 1)


def gradient_divergence(
    neutral: np.ndarray, inside: np.ndarray, weights: np.ndarray
) -> sparse.csr_matrix:
    """Right-hand side of one coordinate from that row of each triangle's gradient, (V, 3T).

    Args:
        neutral: (V, 3) mm.
        inside: (T, 3) predicted triangles.
        weights: (T, 3) cotangents of their edges.
    """
    index = np.arange(len(inside))[:, None] * 3 + np.arange(3)
    rows, columns, values = [], [], []
    for k in range(3):
        first, second = inside[:, (k + 1) % 3], inside[:, (k + 2) % 3]
        edge = (neutral[first] - neutral[second]) * weights[:, k, None]
        for vertex, sign in ((first, 1.0), (second, -1.0)):
            rows.append(np.repeat(vertex, 3))
            columns.append(index.ravel())
            values.append(sign * edge.ravel())
    parts = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.csr_matrix(parts, shape=(len(neutral), 3 * len(inside)))
