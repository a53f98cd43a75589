"""Binding points to the nearest places of a triangle mesh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import incidence

#: How many nearest vertices' triangles are candidates.
CANDIDATE_VERTICES = 6


def bind_to_surface(
    vertices: np.ndarray, triangles: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Nearest surface place of each point: triangle (N,) and barycentric weights (N, 3).

    Candidates are the triangles round the nearest vertices, which serves for points that lie near
    a mesh of even triangles.
    """
    used = np.unique(triangles)
    _, near = cKDTree(vertices[used]).query(points, k=min(CANDIDATE_VERTICES, len(used)))
    rows = incidence(triangles, len(vertices))[used[near.reshape(-1)]]
    owner = np.repeat(np.repeat(np.arange(len(points)), near.shape[1]), np.diff(rows.indptr))
    candidate = rows.indices
    weights = closest_barycentric(vertices[triangles[candidate]], points[owner])
    places = np.einsum("nk,nkc->nc", weights, vertices[triangles[candidate]])
    distance = np.linalg.norm(places - points[owner], axis=1)
    order = np.lexsort((candidate, distance, owner))
    first = order[np.searchsorted(owner[order], np.arange(len(points)))]
    return candidate[first].astype(np.int64), weights[first]


def closest_barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights (N, 3) of the place of each triangle (N, 3, 3) nearest to its point (N, 3)."""
    inner = _plane_barycentric(corners, points)
    inside = (inner >= 0).all(axis=1)
    best = np.full(len(points), np.inf)
    weights = inner.copy()
    for a, b in ((0, 1), (1, 2), (2, 0)):
        along = corners[:, b] - corners[:, a]
        length2 = np.maximum((along**2).sum(axis=1), 1e-18)
        fraction = np.clip(((points - corners[:, a]) * along).sum(axis=1) / length2, 0.0, 1.0)
        place = corners[:, a] + fraction[:, None] * along
        distance = np.linalg.norm(points - place, axis=1)
        better = ~inside & (distance < best)
        best[better] = distance[better]
        weights[better] = 0.0
        weights[better, a] = 1.0 - fraction[better]
        weights[better, b] = fraction[better]
    return weights


def _plane_barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights of the foot of the perpendicular; all -1 where the triangle has no area."""
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = points - corners[:, 0]
    d11, d12, d22 = (edge1**2).sum(1), (edge1 * edge2).sum(1), (edge2**2).sum(1)
    d1, d2 = (offset * edge1).sum(1), (offset * edge2).sum(1)
    area = d11 * d22 - d12**2
    flat = area <= 1e-14 * np.maximum(d11 * d22, 1e-30)
    area = np.where(flat, 1.0, area)
    v, w = (d22 * d1 - d12 * d2) / area, (d11 * d2 - d12 * d1) / area
    return np.where(flat[:, None], -1.0, np.stack([1 - v - w, v, w], axis=1))
