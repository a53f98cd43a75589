"""Correction of one frame's mesh from three meshes and three images (Mono13 section 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.detail.flow.crop import FaceCrop
from vermilion.detail.flow.deformation import DeformationSettings, deform_to_flow
from vermilion.detail.flow.six_frame_flow import FlowSettings, SixFrames, corrective_flow
from vermilion.detail.flow.synthetic import (
    FirstFrame,
    masked_residual,
    motion_px,
    synthesise,
)
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster

_MARGIN = 0.06


@dataclass(frozen=True)
class FlowCorrectionSettings:
    """How a frame is corrected.

    Attributes:
        face_px: longest side of the face where the flow is computed.
        flow: weights of the flow.
        deformation: how far the mesh follows the flow.
    """

    face_px: int
    flow: FlowSettings
    deformation: DeformationSettings


@dataclass(frozen=True)
class CorrectedFrame:
    """A corrected mesh and figures.

    Attributes:
        vertices_mm: (V, 3), world.
        before, after: mean absolute photometric residual of the two meshes, display values 0 to 255,
            over the pixels of the face that both texture.
        flow_px: median length of the corrective flow over the face, pixels of the whole image.
    """

    vertices_mm: np.ndarray
    before: float
    after: float
    flow_px: float


def skin_triangles(model: FaceModel) -> np.ndarray:
    """(T,) bool: the skin of the face; the inside of the mouth is not in the first frame's texture."""
    skin = model.regions["face"] & ~model.regions["mouth_inner"]
    return skin[model.triangles].all(axis=1)


class FlowCorrection:
    """Corrects the frames of a take, one at a time, with the texture of its first frame."""

    def __init__(
        self,
        model: FaceModel,
        camera: Camera,
        first_image: np.ndarray,
        first_mm: np.ndarray,
        settings: FlowCorrectionSettings,
    ):
        """`first_image` (h, w, 3) linear and `first_mm` (V, 3) world are of the textured frame."""
        self.triangles, self.camera, self.settings = model.triangles, camera, settings
        self.face_vertices = model.regions["face"]
        self.rigid = model.regions["rigid"]
        self.face = skin_triangles(model)
        crop = self._crop(first_mm[None])
        image = crop.image(first_image)
        self.first = FirstFrame(image, crop.camera, first_mm, self.triangles)

    def correct(self, images: list[np.ndarray], meshes_mm: np.ndarray) -> CorrectedFrame:
        """Correct the mesh of frame t.

        Args:
            images: three linear images (h, w, 3), of t, t + 1, t - 1; at an end of the take, t
                replaces the missing frame.
            meshes_mm: (3, V, 3), world, in the same order.
        """
        meshes = np.asarray(meshes_mm, dtype=np.float64)
        crop = self._crop(meshes)
        true = [crop.image(image) for image in images]
        synthetic = [self._draw(crop.camera, m, p) for m, p in zip(meshes, true, strict=True)]
        frames = SixFrames(
            np.stack([p for s, f in zip(synthetic, true, strict=True) for p in (s.image, f)]),
            np.stack([s.mask for s in synthetic]),
            np.stack([motion_px(synthetic[0], crop.camera, m, self.triangles) for m in meshes[1:]]),
        )
        flow = corrective_flow(frames, self.settings.flow)
        visible = RayCaster(meshes[0], self.triangles).visible(crop.camera, meshes[0])
        mesh = deform_to_flow(
            meshes[0], self.triangles, crop.camera, flow, synthetic[0].mask,
            visible & self.face_vertices, self.rigid, self.settings.deformation,
        )  # fmt: skip
        after = self._draw(crop.camera, mesh, true[0])
        both = synthetic[0].mask & after.mask
        enlarged = crop.size_px[0] / crop.camera.width_px
        length = np.linalg.norm(flow, axis=2)[synthetic[0].mask] * enlarged
        return CorrectedFrame(
            mesh,
            masked_residual(synthetic[0], true[0], both),
            masked_residual(after, true[0], both),
            float(np.median(length)) if len(length) else float("nan"),
        )

    def _crop(self, meshes_mm: np.ndarray) -> FaceCrop:
        points = self.camera.project(meshes_mm[:, self.face_vertices])
        return FaceCrop.around(self.camera, points, _MARGIN, self.settings.face_px)

    def _draw(self, camera: Camera, mesh_mm: np.ndarray, behind: np.ndarray):
        return synthesise(self.first, camera, mesh_mm, self.triangles, self.face, behind)
