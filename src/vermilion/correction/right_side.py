"""Right-hand sides of the integration, compiled: sixteen frames at a time, one a vector lane.

All arrays have the frames last and `LANES` of them, so that every operation on a triangle is one on
whole vector registers. Arithmetic is that of the layers: single precision for predicted layers,
which are no more precise, double for given ones; sums are always in double precision.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from vermilion.storage.kernels import kernel

#: Frames that go together.
LANES = 16
_TILE = 48  # triangles whose layers are mixed together and stay in the nearest cache
_LARGEST_TURN = 2 * np.pi


def _turn_series(degree: int, dtype: type) -> np.ndarray:
    """Coefficients (2, degree + 1), highest first, of sin(a)/a and (1 - cos(a))/a^2.

    Polynomials in s = 2 a^2 / (2 pi)^2 - 1, to rounding over all turns a up to 2 pi: no branches and
    no divisions, so that the loop over frames runs in vector registers.
    """

    def angle(s: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum((s + 1) / 2, 0.0)) * _LARGEST_TURN

    functions = (
        lambda s: np.sinc(angle(s) / np.pi),
        lambda s: 0.5 * np.sinc(angle(s) / (2 * np.pi)) ** 2,
    )
    fits = [Chebyshev.interpolate(f, degree).convert(kind=Polynomial).coef for f in functions]
    return np.array([fit[::-1] for fit in fits], dtype=dtype)


#: Precision -> coefficients.
TURN_SERIES = {
    np.dtype(np.float32): _turn_series(9, np.float32),
    np.dtype(np.float64): _turn_series(17, np.float64),
}
_MATHS = {"contract", "nsz", "arcp"}


@kernel(nogil=True, fastmath=_MATHS, error_model="numpy")
def accumulate(corners, row, weights, points, layers, series, limits, right):
    """right[i] += w (G - I) e for the edges e of every triangle.

    Args:
        corners: (M, 3) int32 rows of `points`.
        row: (L,) int32 row of `right` of each of the points.
        weights: (M, 3) of the edges 12, 20, 01.
        points: (L, 3, LANES).
        layers: (M, 9, LANES).
        series: `TURN_SERIES`.
        limits: `turn_limits`.
        right: (N, 3, LANES) float64, added to.
    """
    last = series.shape[1]
    flow = np.empty((2, 3, LANES), dtype=points.dtype)
    turn, sines, cosines = np.empty((3, LANES), dtype=points.dtype)
    for t in range(corners.shape[0]):
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        layer = layers[t]
        for f in range(LANES):
            x, y, z = layer[0, f], layer[1, f], layer[2, f]
            turn[f] = min((x * x + y * y + z * z) * limits[0] - limits[1], limits[1])
            sines[f], cosines[f] = series[0, 0], series[1, 0]
        for k in range(1, last):
            for f in range(LANES):
                sines[f] = sines[f] * turn[f] + series[0, k]
                cosines[f] = cosines[f] * turn[f] + series[1, k]
        for f in range(LANES):
            x, y, z = layer[0, f], layer[1, f], layer[2, f]
            sine, cosine = sines[f], cosines[f]
            sxx, syy, szz = layer[3, f], layer[4, f], layer[5, f]
            sxy, sxz, syz = layer[6, f], layer[7, f], layer[8, f]
            for edge in range(2):
                end = b if edge == 0 else c
                ex = points[end, 0, f] - points[a, 0, f]
                ey = points[end, 1, f] - points[a, 1, f]
                ez = points[end, 2, f] - points[a, 2, f]
                # p = (S - I) e, then (Q - I)(e + p) + p = (G - I) e
                px = sxx * ex + sxy * ey + sxz * ez
                py = sxy * ex + syy * ey + syz * ez
                pz = sxz * ex + syz * ey + szz * ez
                qx, qy, qz = ex + px, ey + py, ez + pz
                cx, cy, cz = y * qz - z * qy, z * qx - x * qz, x * qy - y * qx
                dx, dy, dz = y * cz - z * cy, z * cx - x * cz, x * cy - y * cx
                flow[edge, 0, f] = sine * cx + cosine * dx + px
                flow[edge, 1, f] = sine * cy + cosine * dy + py
                flow[edge, 2, f] = sine * cz + cosine * dz + pz
        across_a, across_b, across_c = weights[t, 0], weights[t, 1], weights[t, 2]
        ra, rb, rc = row[a], row[b], row[c]
        for k in range(3):
            for f in range(LANES):
                ab, ac = flow[0, k, f], flow[1, k, f]
                flow_ab = across_c * ab
                flow_ac = across_b * ac
                flow_bc = across_a * (ac - ab)
                right[ra, k, f] -= flow_ab + flow_ac
                right[rb, k, f] += flow_ab - flow_bc
                right[rc, k, f] += flow_ac + flow_bc


@kernel(nogil=True)
def accumulate_mixture(corners, row, weights, points, basis, mixture, series, limits, right):
    """`accumulate` for layers `basis @ mixture`, which are made a tile at a time.

    Args:
        basis: (M * 9, R).
        mixture: (R, LANES); others as in `accumulate`.
    """
    made = np.empty((_TILE * 9, LANES), dtype=basis.dtype)
    for first in range(0, corners.shape[0], _TILE):
        last = min(first + _TILE, corners.shape[0])
        part = made[: (last - first) * 9]
        np.dot(basis[first * 9 : last * 9], mixture, part)
        layers = part.reshape(last - first, 9, LANES)
        accumulate(
            corners[first:last], row, weights[first:last], points, layers, series, limits, right
        )


@kernel(nogil=True)
def add_places(rows, basis, mixture, right):
    """right[rows[i]] += basis @ mixture, basis (N * 3, R) and mixture (R, LANES)."""
    made = np.dot(basis, mixture).reshape(len(rows), 3, LANES)
    for i in range(len(rows)):
        for k in range(3):
            for f in range(LANES):
                right[rows[i], k, f] += made[i, k, f]


def turn_limits(dtype: np.dtype) -> np.ndarray:
    """(2,): factor and offset from a squared turn to s."""
    return np.array([2.0 / _LARGEST_TURN**2, 1.0], dtype=dtype)


@kernel(nogil=True)
def gather(frames, ids, points):
    """points[l, k, f] = frames[f, ids[l], k] less the first of the points; spare lanes repeat frame 0."""
    for f in range(LANES):
        source = frames[f if f < frames.shape[0] else 0]
        for k in range(3):
            origin = source[ids[0], k]
            for i in range(len(ids)):
                points[i, k, f] = source[ids[i], k] - origin


@kernel(nogil=True)
def add_frames(frames, ids, solution):
    """frames[f, ids[i], k] += solution[i, k, f]."""
    for i in range(len(ids)):
        for f in range(frames.shape[0]):
            for k in range(3):
                frames[f, ids[i], k] += solution[i, k, f]
