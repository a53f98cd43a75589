"""Colours of an image at the triangles of the skin."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.detail.flow.crop import FaceCrop
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, triangle_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.sampling import sample_bilinear

_MARGIN = 0.06
_GRAZING = 0.25  # cosine of normal and view below which a triangle has no trust


@dataclass(frozen=True)
class SkinObservation:
    """The skin's triangles in one frame.

    Attributes:
        colours: (Q, 3) display values 0 to 255.
        trust: (Q,) in [0, 1]: 1 seen frontally, 0 hidden or oblique.
        normals: (Q, 3) unit normals, camera frame.
    """

    colours: np.ndarray
    trust: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True)
class FaceImage:
    """The face in an image.

    Attributes:
        values: (h, w, 3) float32 display values 0 to 255, slightly blurred.
        camera: of this crop.
    """

    values: np.ndarray
    camera: Camera

    @classmethod
    def of(cls, linear: np.ndarray, camera: Camera, skin_mm: np.ndarray, most_px: int) -> FaceImage:
        """The face `skin_mm` (S, 3) world in `linear` (h, w, 3), at most `most_px` a side.

        Raises ValueError where the face is outside the image.
        """
        crop = FaceCrop.around(camera, camera.project(skin_mm), _MARGIN, most_px)
        return cls(cv2.GaussianBlur(crop.image(linear), (0, 0), 0.8), crop.camera)

    def colours(self, points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Display values (N, 3) at `points_mm` (N, 3) world, and whether they are inside (N,) bool."""
        pixels = self.camera.project(points_mm)
        inside = self.camera.in_image(pixels, 1.0)
        return sample_bilinear(self.values, pixels).astype(np.float64), inside

    def observe(self, fine_mm: np.ndarray, topology: FineTopology) -> SkinObservation:
        """Colours at the centres of the skin's triangles of `fine_mm` (V', 3), world."""
        own = fine_mm[topology.skin_ids]
        centres = own[topology.skin].mean(axis=1)
        normals = triangle_normals(own, topology.skin)
        colours, inside = self.colours(centres)
        towards = normalised(self.camera.centre_mm - centres)
        cosine = (normals * towards).sum(axis=1)
        trust = np.clip((cosine - _GRAZING) / (1 - _GRAZING), 0, 1) * inside
        facing = np.flatnonzero(trust > 0)
        caster = RayCaster(fine_mm, topology.triangles)
        trust[facing] *= caster.visible(self.camera, centres[facing], tolerance_mm=0.5)
        return SkinObservation(colours, trust, normals @ self.camera.rotation.T)
