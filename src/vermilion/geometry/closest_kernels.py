"""Compiled searches for the closest point of triangles.

All that they call stays in this file: numba's cache does not see changes elsewhere. Import it where it
is called: numba takes a quarter of a second, and many jobs need none of this.
"""

from __future__ import annotations

import math

import numpy as np

from vermilion.storage.kernels import kernel


@kernel()
def closest_weights(  # pragma: no cover - compiled
    px: float, py: float, pz: float, abc: np.ndarray
) -> tuple[float, float, float]:
    """Barycentric weights of the point of triangle abc nearest to p (Ericson 2005, 5.1.5)."""
    abx, aby, abz = abc[1, 0] - abc[0, 0], abc[1, 1] - abc[0, 1], abc[1, 2] - abc[0, 2]
    acx, acy, acz = abc[2, 0] - abc[0, 0], abc[2, 1] - abc[0, 1], abc[2, 2] - abc[0, 2]
    apx, apy, apz = px - abc[0, 0], py - abc[0, 1], pz - abc[0, 2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    bpx, bpy, bpz = px - abc[1, 0], py - abc[1, 1], pz - abc[1, 2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        v = d1 / (d1 - d3)
        return 1.0 - v, v, 0.0
    cpx, cpy, cpz = px - abc[2, 0], py - abc[2, 1], pz - abc[2, 2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        w = d2 / (d2 - d6)
        return 1.0 - w, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - w, w
    total = va + vb + vc
    return va / total, vb / total, vc / total


@kernel()
def _box_distance(  # pragma: no cover - compiled
    px: float, py: float, pz: float, box: np.ndarray
) -> float:
    """Squared distance of a point from a box (6,)."""
    dx = max(box[0] - px, 0.0, px - box[3])
    dy = max(box[1] - py, 0.0, py - box[4])
    dz = max(box[2] - pz, 0.0, pz - box[5])
    return dx * dx + dy * dy + dz * dz


@kernel()
def _distance(  # pragma: no cover - compiled
    px: float, py: float, pz: float, u: float, v: float, w: float, abc: np.ndarray
) -> float:
    """Squared distance of a point from a point of a triangle."""
    dx = u * abc[0, 0] + v * abc[1, 0] + w * abc[2, 0] - px
    dy = u * abc[0, 1] + v * abc[1, 1] + w * abc[2, 1] - py
    dz = u * abc[0, 2] + v * abc[1, 2] + w * abc[2, 2] - pz
    return dx * dx + dy * dy + dz * dz


@kernel()
def search(  # pragma: no cover - compiled
    points: np.ndarray, boxes: np.ndarray, starts: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth first, the nearer child first; boxes farther than the best triangle are left out."""
    n_points, n_inner = len(points), len(starts) - 2
    triangle, barycentric = np.zeros(n_points, np.int64), np.zeros((n_points, 3))
    distance = np.empty(n_points)
    stack, away = np.empty(64, np.int64), np.empty(64)
    near = 0
    for row in range(n_points):
        px, py, pz = points[row, 0], points[row, 1], points[row, 2]
        # The triangle of the point before is a bound alone: which of several equally near ones is
        # found does not depend on what was asked before.
        u, v, w = closest_weights(px, py, pz, corners[near])
        least = _distance(px, py, pz, u, v, w, corners[near]) * (1.0 + 1e-9) + 1e-18
        stack[0], away[0], top = 0, 0.0, 1
        while top:
            top -= 1
            node = stack[top]
            if away[top] >= least:
                continue
            if node < n_inner:
                left = _box_distance(px, py, pz, boxes[2 * node + 1])
                right = _box_distance(px, py, pz, boxes[2 * node + 2])
                if left < right:
                    stack[top], away[top] = 2 * node + 2, right
                    stack[top + 1], away[top + 1] = 2 * node + 1, left
                else:
                    stack[top], away[top] = 2 * node + 1, left
                    stack[top + 1], away[top + 1] = 2 * node + 2, right
                top += 2
                continue
            leaf = node - n_inner
            for t in range(starts[leaf], starts[leaf + 1]):
                u, v, w = closest_weights(px, py, pz, corners[t])
                square = _distance(px, py, pz, u, v, w, corners[t])
                if square < least:
                    least, near = square, t
                    barycentric[row, 0], barycentric[row, 1], barycentric[row, 2] = u, v, w
        triangle[row] = near
        distance[row] = math.sqrt(least)
    return triangle, barycentric, distance


@kernel()
def closest_of(  # pragma: no cover - compiled
    points: np.ndarray, normals: np.ndarray, sides: np.ndarray, rows: np.ndarray,
    candidates: np.ndarray, corners: np.ndarray, face_normals: np.ndarray, face_sides: np.ndarray,
    min_cosine: float, best: np.ndarray, triangle: np.ndarray, barycentric: np.ndarray,
) -> None:  # fmt: skip
    """Keep in `best`, `triangle`, `barycentric` the nearest of the candidate triangles."""
    for index in range(len(rows)):
        row = rows[index]
        px, py, pz = points[row]
        nx, ny, nz = normals[row]
        least = best[row] ** 2
        for t in candidates[index]:
            if sides[row] != 0 and face_sides[t] != 0 and sides[row] != face_sides[t]:
                continue
            if min_cosine > -1.0:
                fx, fy, fz = face_normals[t]
                if nx * fx + ny * fy + nz * fz < min_cosine:
                    continue
            u, v, w = closest_weights(px, py, pz, corners[t])
            dx = u * corners[t, 0, 0] + v * corners[t, 1, 0] + w * corners[t, 2, 0] - px
            dy = u * corners[t, 0, 1] + v * corners[t, 1, 1] + w * corners[t, 2, 1] - py
            dz = u * corners[t, 0, 2] + v * corners[t, 1, 2] + w * corners[t, 2, 2] - pz
            square = dx * dx + dy * dy + dz * dz
            if square < least:
                least = square
                best[row] = math.sqrt(square)
                triangle[row] = t
                barycentric[row, 0], barycentric[row, 1], barycentric[row, 2] = u, v, w


@kernel()
def weights_of(  # pragma: no cover - compiled
    points: np.ndarray, corners: np.ndarray
) -> np.ndarray:
    """`closest_barycentric`, compiled."""
    weights = np.empty((len(points), 3))
    for row in range(len(points)):
        x, y, z = points[row]
        weights[row, 0], weights[row, 1], weights[row, 2] = closest_weights(x, y, z, corners[row])
    return weights
