"""From a correction layer to vertices: deformation transfer (Sumner and Popovic 2004).

With G_t the gradient of the layer at triangle t and c the coarse mesh of the frame, the corrected
mesh x minimises, over the free vertices of the domain,

    sum_t sum_(ij in t) w_ij |(x_i - x_j) - G_t (c_i - c_j)|^2  +  sum_i h_i |x_i - c_i|^2

with cotangent weights w of the neutral, G_t = I outside the mask, and x = c at fixed vertices. For
the displacement d = x - c only mask triangles have a right-hand side, (G_t - I)(c_i - c_j), and the
matrix depends on the neutral alone: it is factored once a topology and person, and all coordinates
of all frames of a block are solved together. Cotangents are kept positive, so that the matrix is
definite on any mesh; weights do not matter where a mesh with these gradients exists: it is returned.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy import sparse

from vermilion.correction.domain import integration_domain
from vermilion.sparse import CholeskyFactor

_COTANGENT_RANGE = (0.02, 50.0)


class LayerIntegrator:
    """Integrates correction layers over one topology and neutral; factors on construction.

    Attributes:
        mask: (M,) triangle ids of the layer.
        free: (N,) ids of the vertices that may move.
        matrix: (N, N) of the system; `factor`: its Cholesky factor.
        weights: (M, 3) of the edges 12, 20, 01 of each mask triangle.
    """

    def __init__(
        self,
        neutral_mm: np.ndarray,
        triangles: np.ndarray,
        mask: np.ndarray,
        seam_mm: float = 16.0,
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
        self.matrix = sparse.csc_matrix(stiffness[self.free][:, self.free] + hold)
        self.factor = CholeskyFactor(self.matrix)
        # The kernel sees only the corners of mask triangles; fixed ones go to a waste row.
        self._local = np.unique(inside)
        position = np.full(len(neutral_mm), len(self.free))
        position[self.free] = np.arange(len(self.free))
        self._row = position[self._local].astype(np.int32)
        self._corners = np.searchsorted(self._local, inside).astype(np.int32)
        self.weights = weights

    def integrate(self, coarse: np.ndarray, layers: np.ndarray, block: int = 32) -> np.ndarray:
        """Corrected vertices, (F, V, 3) float64.

        Args:
            coarse: (F, V, 3), in the layers' frame (the canonical head frame).
            layers: (F, M, 9).
            block: frames solved together; changes no result.
        """
        coarse = np.asarray(coarse, dtype=np.float64)
        if layers.shape != (len(coarse), len(self.mask), 9):
            raise ValueError(
                f"layers must be ({len(coarse)}, {len(self.mask)}, 9), got {layers.shape}"
            )
        corrected = coarse.copy()
        for first in range(0, len(coarse), block):
            part = slice(first, first + block)
            frames_last = np.ascontiguousarray(np.transpose(layers[part], (1, 2, 0)))
            corrected[part, self.free] += self.displacements(coarse[part], frames_last)
        return corrected

    def displacements(self, coarse: np.ndarray, layers_frames_last: np.ndarray) -> np.ndarray:
        """What to add to the free vertices, (F, N, 3); layers are (M, 9, F), the fast order."""
        right = self.right_side(coarse, layers_frames_last)
        solution = self.factor.solve(right.reshape(len(self.free), -1))
        return np.transpose(solution.reshape(right.shape), (2, 0, 1))

    def right_side(self, coarse: np.ndarray, layers_frames_last: np.ndarray) -> np.ndarray:
        """Divergence of the wanted edge changes, (N, 3, F)."""
        corners = np.ascontiguousarray(np.transpose(coarse[:, self._local], (1, 2, 0)))
        right = np.zeros((len(self.free) + 1, 3, corners.shape[2]))
        _accumulate(self._corners, self._row, self.weights, corners, layers_frames_last, right)
        return right[:-1]


def cotangents(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Half the cotangent of the angle opposite each edge (12, 20, 01), (T, 3), kept positive."""
    weights = np.empty((len(triangles), 3))
    for k in range(3):
        a, b, c = (vertices[triangles[:, (k + i) % 3]] for i in range(3))
        along, across = b - a, c - a
        area = np.linalg.norm(np.cross(along, across), axis=1)
        cotangent = (along * across).sum(axis=1) / np.maximum(area, 1e-12)
        weights[:, k] = 0.5 * np.clip(cotangent, *_COTANGENT_RANGE)
    return weights


def edge_stiffness(
    triangles: np.ndarray, weights: np.ndarray, n_vertices: int
) -> sparse.csr_matrix:
    """Matrix (V, V) of the energy sum w_ij |x_i - x_j|^2; weights (T, 3) of edges 12, 20, 01."""
    first = triangles[:, [1, 2, 0]].ravel()
    second = triangles[:, [2, 0, 1]].ravel()
    values = weights.ravel()
    rows = np.concatenate([first, second, first, second])
    columns = np.concatenate([first, second, second, first])
    data = np.concatenate([values, values, -values, -values])
    return sparse.csr_matrix((data, (rows, columns)), shape=(n_vertices, n_vertices))


# sin(a)/a and (1 - cos(a))/a^2 as series in a^2: to rounding for a turn of pi, 1e-8 at 2 pi. Only
# additions and products, so that the loop over frames runs in vector registers.
_TERMS = 15
_factorials = np.cumprod(np.arange(1.0, 2 * _TERMS + 3))
_SINE = (-1.0) ** np.arange(_TERMS) / _factorials[0 : 2 * _TERMS : 2]
_COSINE = (-1.0) ** np.arange(_TERMS) / _factorials[1 : 2 * _TERMS + 1 : 2]
_MAX_SQUARED_TURN = 39.0


@numba.njit(cache=True, nogil=True, fastmath={"contract", "nsz", "arcp"}, error_model="numpy")
def _accumulate(corners, row, weights, points, layers, right):
    """right[i] += w (G - I) e for the edges e of every mask triangle; frames are innermost."""
    n_frames = points.shape[2]
    change = np.empty((2, 3, n_frames))
    for t in range(corners.shape[0]):
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        layer = layers[t]
        for f in range(n_frames):
            x, y, z = float(layer[0, f]), float(layer[1, f]), float(layer[2, f])
            turn = min(x * x + y * y + z * z, _MAX_SQUARED_TURN)
            sine, cosine = _SINE[_TERMS - 1], _COSINE[_TERMS - 1]
            for k in range(_TERMS - 2, -1, -1):
                sine = sine * turn + _SINE[k]
                cosine = cosine * turn + _COSINE[k]
            sxx, syy, szz = layer[3, f], layer[4, f], layer[5, f]
            sxy, sxz, syz = layer[6, f], layer[7, f], layer[8, f]
            for edge in range(2):
                end = b if edge == 0 else c
                ex = points[end, 0, f] - points[a, 0, f]
                ey = points[end, 1, f] - points[a, 1, f]
                ez = points[end, 2, f] - points[a, 2, f]
                # p = (S - I) e, then d = (Q - I)(e + p) + p = (G - I) e
                px = sxx * ex + sxy * ey + sxz * ez
                py = sxy * ex + syy * ey + syz * ez
                pz = sxz * ex + syz * ey + szz * ez
                qx, qy, qz = ex + px, ey + py, ez + pz
                cx, cy, cz = y * qz - z * qy, z * qx - x * qz, x * qy - y * qx
                dx, dy, dz = y * cz - z * cy, z * cx - x * cz, x * cy - y * cx
                change[edge, 0, f] = sine * cx + cosine * dx + px
                change[edge, 1, f] = sine * cy + cosine * dy + py
                change[edge, 2, f] = sine * cz + cosine * dz + pz
        opposite_a, opposite_b, opposite_c = weights[t, 0], weights[t, 1], weights[t, 2]
        ra, rb, rc = row[a], row[b], row[c]
        for k in range(3):
            for f in range(n_frames):
                ab, ac = change[0, k, f], change[1, k, f]
                flow_ab = opposite_c * ab
                flow_ac = opposite_b * ac
                flow_bc = opposite_a * (ac - ab)
                right[ra, k, f] -= flow_ab + flow_ac
                right[rb, k, f] += flow_ab - flow_bc
                right[rc, k, f] += flow_ac + flow_bc
