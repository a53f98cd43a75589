"""Landmarks of the neutral image carried onto a mesh by ray casting."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import Mesh, triangle_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.landmarks.scheme import JAW


def back_project(
    points_px: np.ndarray, camera: Camera, mesh: Mesh, max_grazing_deg: float = 70.0
) -> SurfacePoints:
    """Where the rays of pixels meet a mesh.

    Args:
        points_px: (N, 2), NaN where unknown.
        camera: of the pixels.
        mesh: in the camera's world, mm.
        max_grazing_deg: a ray that meets the mesh further off its normal is not used: there a pixel
            of error is many millimetres on the surface.

    Returns:
        N points; unbound where a ray misses the mesh or grazes it.
    """
    finite = np.isfinite(points_px).all(axis=1)
    origins, directions = camera.rays(np.where(finite[:, None], points_px, 0.0))
    hits = RayCaster(mesh.vertices_mm, mesh.triangles).cast(origins, directions)
    normals = triangle_normals(mesh.vertices_mm, mesh.triangles)[np.maximum(hits.triangle, 0)]
    facing = -(normals * directions).sum(axis=1)
    good = finite & hits.hit & (facing > np.cos(np.deg2rad(max_grazing_deg)))
    triangle = np.where(good, hits.triangle, -1).astype(np.int32)
    return SurfacePoints(triangle, hits.barycentric.astype(np.float64))


def inner_features(points: SurfacePoints) -> SurfacePoints:
    """The same without the jaw's outline, which is no fixed place of the skin."""
    return points.restricted(~np.isin(np.arange(len(points)), JAW))
