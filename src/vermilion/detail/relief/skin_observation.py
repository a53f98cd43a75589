"""Colours of an image at the triangles of the skin."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.appearance.harmonics import harmonics
from vermilion.appearance.visibility import light_transfer
from vermilion.detail.flow.crop import FaceCrop
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, triangle_normals, vertex_normals
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
        transfer: (Q, 9, 9) float32 what reaches each triangle of the light (`light_transfer`); None: all.
    """

    colours: np.ndarray
    trust: np.ndarray
    normals: np.ndarray
    transfer: np.ndarray | None = None

    def basis(self, normals: np.ndarray) -> np.ndarray:
        """Harmonics (Q, 9) of the light at triangles with unit `normals` (Q, 3), camera frame."""
        basis = harmonics(normals)
        if self.transfer is None:
            return basis
        return np.einsum("qk,qkj->qj", basis, self.transfer)


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
        """Mean colours of the skin's triangles of `fine_mm` (V', 3), world."""
        own = fine_mm[topology.skin_ids]
        corners = own[topology.skin]
        centres = corners.mean(axis=1)
        normals = triangle_normals(own, topology.skin)
        colours, inside = self.colours(centres)
        for k in range(3):
            colours += self.colours(0.5 * (centres + corners[:, k]))[0]
        colours /= 4
        towards = normalised(self.camera.centre_mm - centres)
        cosine = (normals * towards).sum(axis=1)
        trust = np.clip((cosine - _GRAZING) / (1 - _GRAZING), 0, 1) * inside
        facing = np.flatnonzero(trust > 0)
        caster = RayCaster(fine_mm, topology.triangles)
        trust[facing] *= caster.visible(self.camera, centres[facing], tolerance_mm=0.5)
        rotation = self.camera.rotation
        transfer = _transfer(caster, fine_mm, topology, rotation)
        return SkinObservation(colours, trust, normals @ rotation.T, transfer)


def _transfer(
    caster: RayCaster, fine_mm: np.ndarray, topology: FineTopology, world_to_camera: np.ndarray
) -> np.ndarray:
    """`light_transfer` (Q, 9, 9) float32 of the skin's triangles, by rays from the coarse vertices.

    `fine_mm` (V', 3) world, of which the first are the coarse vertices; `caster` of this mesh.
    """
    finer = topology.finer[topology.skin_ids]
    used = np.flatnonzero(finer.getnnz(axis=0))
    normals = vertex_normals(fine_mm, topology.triangles)[used]
    coarse = np.zeros((finer.shape[1], 81))
    coarse[used] = light_transfer(caster, fine_mm[used], normals, world_to_camera).reshape(-1, 81)
    corners = (finer @ coarse).astype(np.float32)[topology.skin]
    return corners.mean(axis=1).reshape(-1, 9, 9)
