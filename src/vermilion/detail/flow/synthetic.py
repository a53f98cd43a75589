"""Synthetic frames: the mesh, textured once and for all from the first frame (Mono13 7.1).

The texture has no map: the point of the mesh that a pixel shows is followed to the first frame and
its colour is read there, so that no resolution is lost.
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
    """The image that textures the mesh, and the mesh as it was then."""

    def __init__(
        self, image: np.ndarray, camera: Camera, vertices_mm: np.ndarray, triangles: np.ndarray
    ):
        """`image` (h, w, 3) float32 is `camera`'s, `vertices_mm` (V, 3) in the world."""
        self.image, self.camera = image, camera
        self.vertices_mm = np.asarray(vertices_mm, dtype=np.float64)
        caster = RayCaster(self.vertices_mm, triangles)
        towards = camera.centre_mm - self.vertices_mm
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        facing = (vertex_normals(self.vertices_mm, triangles) * towards).sum(axis=1)
        seen = caster.visible(camera, self.vertices_mm, _DEPTH_TOLERANCE_MM)
        self._seen = (seen & (facing > _LEAST_FACING)).astype(np.float32)

    def colours(self, hits: Hits, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Colours (h, w, 3) of what pixels show, and whether the first frame shows it, (h, w)."""
        pixels = self.camera.project(interpolate(hits, triangles, self.vertices_mm))
        places = np.where(hits.hit[..., None], np.nan_to_num(pixels), 0).astype(np.float32) - 0.5
        colours = cv2.remap(
            self.image, places, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        return colours, hits.hit & (interpolate(hits, triangles, self._seen) > 0.99)


@dataclass(frozen=True)
class SyntheticFrame:
    """What the camera would see if the mesh were right.

    Attributes:
        image: (h, w, 3) float32 display values; the true image where there is no texture.
        mask: (h, w) bool, textured face.
        hits: what the pixels show.
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
        vertices_mm: (V, 3) in the world.
        face: (T,) bool, triangles that may be compared with the image.
        behind: (h, w, 3) what is shown where there is no texture.
    """
    hits = RayCaster(vertices_mm, triangles).see(camera)
    colours, known = first.colours(hits, triangles)
    mask = known & face[np.maximum(hits.triangle, 0)]
    image = np.where(mask[..., None], colours, behind).astype(np.float32)
    return SyntheticFrame(image, mask, hits)


def motion_px(
    frame: SyntheticFrame, camera: Camera, vertices_mm: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """How the points that pixels show move to other vertices (V, 3), (h, w, 2) px; 0 off the mesh."""
    there = camera.project(interpolate(frame.hits, triangles, np.asarray(vertices_mm, np.float64)))
    motion = there - camera.pixel_grid()
    return np.where(frame.hits.hit[..., None], np.nan_to_num(motion), 0).astype(np.float32)


def masked_residual(frame: SyntheticFrame, image: np.ndarray, mask: np.ndarray) -> float:
    """Mean absolute difference to the image over a mask, display values 0 to 255; NaN if empty."""
    return float(np.abs(frame.image - image)[mask].mean()) if mask.any() else float("nan")
