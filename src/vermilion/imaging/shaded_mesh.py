"""A shaded mesh over an image, one ray a pixel."""

from __future__ import annotations

import math

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.storage.kernels import kernel

_LIGHT = np.array([-0.35, -0.45, -0.82]) / np.linalg.norm([-0.35, -0.45, -0.82])
_DISPLAY = np.array([255 * (i / 1023) ** (1 / 1.3) for i in range(1024)])


def shade(
    image: np.ndarray,
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    colours: np.ndarray,
    opacity: float,
) -> np.ndarray:
    """A shaded mesh over an image: light from the upper left, a soft sheen, dark insides.

    Args:
        image: (h, w, 3) uint8.
        camera: of the image.
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        colours: (V, 3) in [0, 1].
        opacity: 0 to 1.

    Returns:
        (h, w, 3) uint8.
    """
    rays = camera.rays(camera.pixel_grid())
    return ShadedMesh(vertices_mm, triangles, colours).over(image, camera, rays, opacity)


class ShadedMesh:
    """A mesh that is drawn into several images; its scene and normals are made once.

    Args:
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        colours: (V, 3) in [0, 1].
    """

    def __init__(self, vertices_mm: np.ndarray, triangles: np.ndarray, colours: np.ndarray):
        self._caster = RayCaster(vertices_mm, triangles)
        self._normals = vertex_normals(vertices_mm, triangles)
        self._triangles = np.ascontiguousarray(triangles)
        self._colours = np.ascontiguousarray(colours, dtype=np.float64)

    def over(
        self,
        image: np.ndarray,
        camera: Camera,
        rays: tuple[np.ndarray, np.ndarray],
        opacity: float,
    ) -> np.ndarray:
        """The mesh over an image, (h, w, 3) uint8.

        Args:
            image: (h, w, 3) uint8.
            camera: of the image.
            rays: origins and directions of its pixels, both (h, w, 3), as `Camera.rays` gives them.
            opacity: 0 to 1.
        """
        origins, directions = rays
        hits = self._caster.cast(origins, directions)
        local = np.ascontiguousarray(directions.reshape(-1, 3) @ camera.rotation.T)
        result = np.ascontiguousarray(image).copy()
        _shade(
            hits.triangle.ravel(), hits.barycentric.reshape(-1, 3), local, self._triangles,
            np.ascontiguousarray(self._normals @ camera.rotation.T), self._colours, float(opacity),
            result.reshape(-1, 3),
        )  # fmt: skip
        return result


@kernel()
def _shade(  # pragma: no cover - compiled
    triangle, barycentric, directions, triangles, normals, colours, opacity, out
):
    """Lambert and Blinn in the camera's frame; the back of a surface is dark."""
    n = np.empty(3)
    albedo = np.empty(3)
    for pixel in range(len(triangle)):
        t = triangle[pixel]
        if t < 0:
            continue
        for k in range(3):
            n[k] = albedo[k] = 0.0
            for corner in range(3):
                weight = barycentric[pixel, corner]
                n[k] += weight * normals[triangles[t, corner], k]
                albedo[k] += weight * colours[triangles[t, corner], k]
        length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        if length == 0.0:
            continue
        facing = -(n[0] * directions[pixel, 0] + n[1] * directions[pixel, 1])
        facing -= n[2] * directions[pixel, 2]
        sign = 1.0 if facing >= 0 else -1.0
        diffuse = across = square = 0.0
        for k in range(3):
            half = _LIGHT[k] - directions[pixel, k]
            diffuse += n[k] * _LIGHT[k]
            across += n[k] * half
            square += half * half
        diffuse = min(max(sign * diffuse / length, 0.0), 1.0)
        across = min(max(sign * across / (length * math.sqrt(square)), 0.0), 1.0)
        for k in range(3):
            value = albedo[k] * (0.22 + 0.78 * diffuse) + 0.18 * across**25
            if sign < 0:
                value *= 0.35
            shown = _DISPLAY[int(1023 * min(max(value, 0.0), 1.0))]
            mixed = out[pixel, k] * (1 - opacity) + shown * opacity
            out[pixel, k] = np.uint8(min(max(mixed + 0.5, 0.0), 255.0))
