"""Landmarks of several views to points in space, with outliers among the views left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vermilion.geometry.camera import Camera


@dataclass(frozen=True)
class Triangulated:
    """Points in space.

    Attributes:
        points_mm: (N, 3), NaN where not valid.
        weights: (N,) in [0, 1], zero where not valid.
        residual_px: (N,) root mean square reprojection of the views used.
        valid: (N,) bool.
    """

    points_mm: np.ndarray
    weights: np.ndarray
    residual_px: np.ndarray
    valid: np.ndarray


def triangulate_landmarks(
    cameras: Mapping[str, Camera],
    names: Sequence[str],
    points_px: np.ndarray,
    confidence: np.ndarray,
    *,
    min_confidence: float,
    max_distance_mm: float,
) -> Triangulated:
    """Robust triangulation: of all pairs of views, the point most views agree with, refined.

    Args:
        cameras: by name.
        names: C camera names, in the order of the arrays.
        points_px: (C, N, 2).
        confidence: (C, N) in [0, 1].
        min_confidence: views below it are not used.
        max_distance_mm: a view agrees where its ray passes within this distance of the point.
    """
    rays = [cameras[name].rays(points_px[i]) for i, name in enumerate(names)]
    origins = np.stack([r[0] for r in rays])
    directions = np.stack([r[1] for r in rays])
    n = points_px.shape[1]
    points = np.full((n, 3), np.nan)
    weights, residual = np.zeros(n), np.full(n, np.nan)
    for i in range(n):
        use = np.flatnonzero(confidence[:, i] >= min_confidence)
        best = _consensus(origins[use, i], directions[use, i], confidence[use, i], max_distance_mm)
        if best is None:
            continue
        point, inliers = best
        points[i] = point
        used = use[inliers]
        errors = [np.linalg.norm(cameras[names[c]].project(point) - points_px[c, i]) for c in used]
        residual[i] = np.sqrt(np.mean(np.square(errors)))
        weights[i] = confidence[used, i].mean() * len(used) / max(len(use), 1)
    return Triangulated(points, weights, residual, weights > 0)


def _consensus(origins, directions, confidence, limit_mm):
    """Point (3,) and which rays agree with it; None where no two rays do."""
    best, best_score = None, 0.0
    for a, b in combinations(range(len(origins)), 2):
        point = nearest_point(origins[[a, b]], directions[[a, b]], np.ones(2))
        inliers = ray_distance(origins, directions, point) < limit_mm
        score = confidence[inliers].sum()
        if inliers.sum() >= 2 and score > best_score:
            best, best_score = inliers, score
    if best is None:
        return None
    point = nearest_point(origins[best], directions[best], confidence[best])
    return point, np.flatnonzero(best)


def nearest_point(
    origins_mm: np.ndarray, directions: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Point nearest to rays in weighted least squares.

    Args:
        origins_mm: (C, 3) world, mm.
        directions: (C, 3) unit.
        weights: (C,).

    Returns:
        (3,) world, mm.
    """
    project = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    project = project * weights[:, None, None]
    right = np.einsum("cij,cj->i", project, origins_mm)
    return np.linalg.solve(project.sum(axis=0) + 1e-9 * np.eye(3), right)


def ray_distance(
    origins_mm: np.ndarray, directions: np.ndarray, point_mm: np.ndarray
) -> np.ndarray:
    """Distance of a point to each ray.

    Args:
        origins_mm: (C, 3) world, mm.
        directions: (C, 3) unit.
        point_mm: (3,) world, mm.

    Returns:
        (C,) mm.
    """
    towards = point_mm - origins_mm
    along = (towards * directions).sum(axis=-1, keepdims=True) * directions
    return np.linalg.norm(towards - along, axis=-1)
