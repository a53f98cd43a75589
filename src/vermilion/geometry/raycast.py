"""Ray casting with embree: what a camera sees of a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from vermilion.geometry.camera import Camera


@dataclass(frozen=True)
class Hits:
    """Where rays meet a mesh.

    Attributes:
        triangle: (...,) int32, -1 where nothing is hit.
        barycentric: (..., 3) float32 weights of the triangle's corners.
        distance_mm: (...,) float32 along the unit ray, infinite where nothing is hit.
    """

    triangle: np.ndarray
    barycentric: np.ndarray
    distance_mm: np.ndarray

    @property
    def hit(self) -> np.ndarray:
        """(...) bool: rays that meet the mesh."""
        return self.triangle >= 0


class RayCaster:
    """An embree scene of one mesh; build it once a frame, cast from every camera."""

    def __init__(self, vertices_mm: np.ndarray, triangles: np.ndarray):
        """Build the scene of vertices_mm (V, 3) in the world and triangles (T, 3)."""
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(
            self._scene, np.ascontiguousarray(vertices_mm, dtype=np.float32), self.triangles
        )

    def cast(self, origins_mm: np.ndarray, directions: np.ndarray) -> Hits:
        """First hit of rays.

        Args:
            origins_mm: (3,) or (..., 3) in the mesh's world, mm.
            directions: (..., 3) unit.

        Returns:
            hits (...).
        """
        shape = directions.shape[:-1]
        origins = np.ascontiguousarray(
            np.broadcast_to(origins_mm, directions.shape).reshape(-1, 3), dtype=np.float32
        )
        flat = np.ascontiguousarray(directions.reshape(-1, 3), dtype=np.float32)
        result = self._scene.run(origins, flat, output=1)
        triangle = result["primID"].astype(np.int32)
        hit = triangle >= 0
        u, v = result["u"], result["v"]
        barycentric = np.stack([1 - u - v, u, v], axis=-1)
        barycentric[~hit] = 0
        distance = np.where(hit, result["tfar"], np.inf).astype(np.float32)
        return Hits(
            triangle.reshape(shape), barycentric.reshape(*shape, 3), distance.reshape(shape)
        )

    def occluded(self, origins_mm: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Whether anything lies in the way of rays: any hit serves, which is twice as quick as the first.

        Args:
            origins_mm: (3,) or (..., 3) in the mesh's world, mm.
            directions: (..., 3) unit.

        Returns:
            (...) bool.
        """
        shape = directions.shape[:-1]
        origins = np.broadcast_to(origins_mm, directions.shape).reshape(-1, 3)
        flat = np.ascontiguousarray(directions.reshape(-1, 3), dtype=np.float32)
        origins = np.ascontiguousarray(origins, dtype=np.float32)
        return (self._scene.run(origins, flat, query="OCCLUDED") >= 0).reshape(shape)

    def see(self, camera: Camera) -> Hits:
        """One ray through the centre of each pixel, (height, width)."""
        return self.cast(*camera.rays(camera.pixel_grid()))

    def visible(
        self, camera: Camera, points_mm: np.ndarray, tolerance_mm: float = 0.2
    ) -> np.ndarray:
        """Which points on the surface a camera sees: in the image and not hidden.

        Args:
            camera: in the mesh's world.
            points_mm: (N, 3) on the mesh, world, mm.
            tolerance_mm: how far in front of a point the mesh may lie.

        Returns:
            (N,) bool.
        """
        pixels = camera.project(points_mm)
        inside = camera.in_image(pixels)
        towards = points_mm - camera.centre_mm
        distance = np.linalg.norm(towards, axis=1)
        hits = self.cast(camera.centre_mm, towards / distance[:, None])
        return inside & (hits.distance_mm >= distance - tolerance_mm)


def interpolate(hits: Hits, triangles: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values of vertices at the hits of rays.

    Args:
        hits: of rays (...).
        triangles: (T, 3) of the mesh.
        values: (V, D) or (V,) of its vertices.

    Returns:
        (..., D) or (...); zero where nothing is hit.
    """
    hit = hits.triangle >= 0
    corners, weights = triangles[hits.triangle[hit]].T, hits.barycentric[hit].T
    if values.ndim == 2:
        weights = weights[..., None]
    found = weights[0] * values[corners[0]]
    for corner, weight in zip(corners[1:], weights[1:], strict=True):
        found += weight * values[corner]
    result = np.zeros((*hits.triangle.shape, *values.shape[1:]), dtype=found.dtype)
    result[hit] = found
    return result
