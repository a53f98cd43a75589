"""Dense non-rigid registration of a mesh to an oriented point cloud."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import vertex_normals
from vermilion.multiview.solver import ThinPlate, solve_displacement
from vermilion.multiview.stereo import Cloud

#: Smallest cosine between the normals of vertex and point; weight of the tangential part of a match,
#: against 1 for the normal part.
_MIN_COSINE, _SLIDE = 0.5, 0.02


def register_to_cloud(
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    cloud: Cloud,
    matchable: np.ndarray,
    *,
    lengths_mm: Sequence[float] | np.ndarray,
    gates_mm: Sequence[float] | np.ndarray,
    spacing_mm: float,
) -> np.ndarray:
    """Point-to-plane registration with annealed stiffness (after Amberg et al. 2007), (V, 3) mm.

    Args:
        vertices_mm: (V, 3) start, near the cloud, world, mm.
        triangles: (T, 3).
        cloud: in the same world.
        matchable: (V,) bool; others follow the smooth prior.
        lengths_mm: (R,) stiffness of each round (see `solver`), falling.
        gates_mm: (R,) largest distance of a match of each round.
        spacing_mm: of the cloud; a match that lies to the side by more than twice as much is past
            the cloud's border and dropped.
    """
    tree = cKDTree(cloud.points_mm)
    current = vertices_mm.copy()
    plate = ThinPlate.of(vertices_mm, triangles)
    for length, gate in zip(lengths_mm, gates_mm, strict=True):
        normals = vertex_normals(current, triangles)
        distance, nearest = tree.query(current, distance_upper_bound=1.5 * gate)
        found = np.isfinite(distance)
        nearest = np.where(found, nearest, 0)
        offset = cloud.points_mm[nearest] - current
        normal = cloud.normals[nearest]
        height = (offset * normal).sum(axis=1)
        aside = np.linalg.norm(offset - height[:, None] * normal, axis=1)
        alike = (normal * normals).sum(axis=1) >= _MIN_COSINE
        good = found & alike & matchable & (np.abs(height) < gate) & (aside < 2 * spacing_mm)
        scale = max(1.4826 * np.median(np.abs(height[good])) if good.any() else 1.0, 0.05)
        weight = np.where(good, 1.0 / np.maximum(np.abs(height) / (2 * scale), 1.0), 0.0)
        outer = normal[:, :, None] * normal[:, None, :]
        blocks = weight[:, None, None] * (outer + _SLIDE * np.eye(3))
        right = weight[:, None] * height[:, None] * normal
        # stiffness acts on the whole displacement since the start, so that rounds do not add up
        moved = current - vertices_mm
        right += np.einsum("vij,vj->vi", blocks, moved)
        current = vertices_mm + solve_displacement(plate, blocks, right, length)
    return current
