"""What an image shows at the triangles of the skin."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.detail.flow.crop import FaceCrop
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, triangle_normals
from vermilion.geometry.raycast import RayCaster

_MARGIN = 0.06
_COLUMNS = 256
_GRAZING = 0.25  # cosine to the view below which a triangle tells nothing


@dataclass(frozen=True)
class SkinObservation:
    """One frame.

    Attributes:
        colours: (Q, 3) display values 0 to 255.
        trust: (Q,) in [0, 1]: how squarely a triangle is seen; zero where it is not.
        normals: (Q, 3) unit, camera frame.
    """

    colours: np.ndarray
    trust: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True)
class FaceImage:
    """The image about the face.

    Attributes:
        values: (h, w, 3) float32 display values 0 to 255, softened.
        camera: of this crop.
    """

    values: np.ndarray
    camera: Camera

    @classmethod
    def of(cls, linear: np.ndarray, camera: Camera, skin_mm: np.ndarray, most_px: int):
        """From a linear image (h, w, 3); the face reduced to `most_px`; ValueError if not in it."""
        crop = FaceCrop.around(camera, camera.project(skin_mm), _MARGIN, most_px)
        return cls(cv2.GaussianBlur(crop.image(linear), (0, 0), 0.8), crop.camera)

    def colours(self, points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Display values (N, 3) at points (N, 3) in the world, and whether they are in it (N,)."""
        pixels = self.camera.project(points_mm)
        inside = self.camera.in_image(pixels, 1.0)
        place = np.where(inside[:, None], pixels - 0.5, 0).astype(np.float32)
        # OpenCV takes no more than 32767 rows: the points are folded into a table.
        table = np.zeros((-(-len(place) // _COLUMNS) * _COLUMNS, 2), dtype=np.float32)
        table[: len(place)] = place
        table = table.reshape(-1, _COLUMNS, 2)
        found = cv2.remap(self.values, table, None, cv2.INTER_LINEAR).reshape(-1, 3)
        return found[: len(place)].astype(np.float64), inside

    def observe(self, fine_mm: np.ndarray, topology: FineTopology) -> SkinObservation:
        """At the centres of the skin's triangles of a fine mesh (V', 3)."""
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
