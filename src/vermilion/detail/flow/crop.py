"""The part of an image that shows the face, at the working resolution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.images import linear_to_srgb


@dataclass(frozen=True)
class FaceCrop:
    """A rectangle of a camera's image, resized.

    Attributes:
        camera: the camera of the resized rectangle.
        corner_px: left and top edge in the whole image.
        size_px: width and height in the whole image.
    """

    camera: Camera
    corner_px: tuple[int, int]
    size_px: tuple[int, int]

    @classmethod
    def around(cls, camera: Camera, points_px: np.ndarray, margin: float, most_px: int) -> FaceCrop:
        """Crop around some points; never enlarged.

        Args:
            camera: of the image.
            points_px: (..., 2) to be inside.
            margin: added on each side, as a share of the points' extent.
            most_px: longest side of the resized crop.

        Raises:
            ValueError: the points lie outside the image.
        """
        points = points_px.reshape(-1, 2)
        points = points[np.isfinite(points).all(axis=1)]
        size = np.array([camera.width_px, camera.height_px])
        if not len(points):
            raise ValueError("no point of the face lies before the camera")
        low, high = points.min(axis=0), points.max(axis=0)
        border = margin * (high - low).max()
        low = np.clip(np.floor(low - border), 0, size).astype(int)
        high = np.clip(np.ceil(high + border), 0, size).astype(int)
        if (high - low < 16).any():
            raise ValueError("the face lies outside the image")
        width, height = (int(n) for n in high - low)
        cut = camera.colmap()
        cut.principal_point_x -= int(low[0])
        cut.principal_point_y -= int(low[1])
        part = replace(camera, params=tuple(cut.params), width_px=width, height_px=height)
        scale = min(1.0, most_px / max(width, height))
        return cls(part.resized(scale), (int(low[0]), int(low[1])), (width, height))

    def image(self, linear: np.ndarray) -> np.ndarray:
        """The crop (h', w', 3) float32 of `linear` (h, w, 3), as display values 0 to 255."""
        (x, y), (width, height) = self.corner_px, self.size_px
        part = linear_to_srgb(linear[y : y + height, x : x + width]) * np.float32(255)
        size = (self.camera.width_px, self.camera.height_px)
        return (
            part
            if size == (width, height)
            else cv2.resize(part, size, interpolation=cv2.INTER_AREA)
        )
