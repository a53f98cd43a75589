"""Synthetic frames: the mesh with the texture of the first frame (Mono13 7.1).

There is no texture map: the point of the mesh that a pixel shows is projected into the first frame
and its colour is sampled there, so no resolution is lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import Hits, RayCaster, interpolate

_DEPTH_TOLERANCE_MM = 1.5
_LEAST_FACING = 0.2


class FirstFrame:
    """The first frame: the image that textures the mesh, and its mesh."""

    def __init__(
        self, image: np.ndarray, camera: Camera, vertices_mm: np.ndarray, triangles: np.ndarray
    ):
        """`image` (h, w, 3) float32 of `camera`, mesh `vertices_mm` (V, 3) world, `triangles` (T, 3)."""
        self.image, self.camera = image, camera
        self.vertices_mm = np.asarray(vertices_mm, dtype=np.float64)
        caster = RayCaster(self.vertices_mm, triangles)
        towards = camera.centre_mm - self.vertices_mm
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        facing = (vertex_normals(self.vertices_mm, triangles) * towards).sum(axis=1)
        seen = caster.visible(camera, self.vertices_mm, _DEPTH_TOLERANCE_MM)
        self._seen = (seen & (facing > _LEAST_FACING)).astype(np.float32)

    def colours(self, hits: Hits, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Colours (h, w, 3) of the points at pixels; whether the first frame shows them, (h, w) bool.

        `triangles` (T, 3) are the mesh's.
        """
        pixels = self.camera.project(interpolate(hits, triangles, self.vertices_mm))
        places = np.where(hits.hit[..., None], np.nan_to_num(pixels), 0).astype(np.float32) - 0.5
        colours = cv2.remap(  # type: ignore[call-overload]  # the second map may be None
            self.image, places, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        return colours, hits.hit & (interpolate(hits, triangles, self._seen) > 0.99)


@dataclass(frozen=True)
class SyntheticFrame:
    """The textured mesh in the camera: equal to the true image if the mesh is right.

    Attributes:
        image: (h, w, 3) float32 display values; the true image where there is no texture.
        mask: (h, w) bool, textured face.
        hits: points of the mesh at the pixels.
    """

    image: np.ndarray
    mask: np.ndarray
    hits: Hits


def synthesise(
    first: FirstFrame,
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    face: np.ndarray,
    behind: np.ndarray,
) -> SyntheticFrame:
    """Draw the textured mesh.

    Args:
        first: the texture.
        camera: of the frame.
        vertices_mm: (V, 3), world.
        triangles: (T, 3).
        face: (T,) bool, triangles that may be compared with the image.
        behind: (h, w, 3) background, where there is no texture.
    """
    hits = RayCaster(vertices_mm, triangles).see(camera)
    colours, known = first.colours(hits, triangles)
    mask = known & face[np.maximum(hits.triangle, 0)]
    image = np.where(mask[..., None], colours, behind).astype(np.float32)
    return SyntheticFrame(image, mask, hits)


def motion_px(
    frame: SyntheticFrame, camera: Camera, vertices_mm: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Motion (h, w, 2) px of the points at pixels to another mesh; 0 off the mesh.

    Args:
        frame: the points.
        camera: of the frame.
        vertices_mm: (V, 3) of the other mesh, world.
        triangles: (T, 3).
    """
    there = camera.project(interpolate(frame.hits, triangles, np.asarray(vertices_mm, np.float64)))
    motion = there - camera.pixel_grid()
    return np.where(frame.hits.hit[..., None], np.nan_to_num(motion), 0).astype(np.float32)


def masked_residual(frame: SyntheticFrame, image: np.ndarray, mask: np.ndarray) -> float:
    """Mean absolute difference to `image` (h, w, 3) over `mask` (h, w) bool; NaN if it is empty."""
    return float(np.abs(frame.image - image)[mask].mean()) if mask.any() else float("nan")
