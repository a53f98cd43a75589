"""Image motion between a picture predicted through the mesh and the real one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.camera import Camera
from vermilion.mesh import vertex_normals
from vermilion.multiview.views import View, sample
from vermilion.raycast import RayCaster


@dataclass(frozen=True)
class Sight:
    """What a camera sees of a mesh's vertices.

    Attributes:
        pixels: (V, 2) where they project.
        visible: (V,) bool: in the picture, facing the camera, not hidden.
        cosine: (V,) of the angle between normal and viewing ray, positive when facing.
    """

    pixels: np.ndarray
    visible: np.ndarray
    cosine: np.ndarray


@dataclass(frozen=True)
class Motion:
    """Where a camera's picture says the vertices are.

    Attributes:
        offset_px: (V, 2) from where they project now.
        weight: (V,) in [0, 1], zero where the camera does not see the vertex or the pictures
            disagree.
    """

    offset_px: np.ndarray
    weight: np.ndarray


def sight(
    caster: RayCaster,
    camera: Camera,
    vertices_mm: np.ndarray,
    normals: np.ndarray | None = None,
    *,
    min_cosine: float = 0.15,
    tolerance_mm: float = 0.3,
) -> Sight:
    """Project and test the visibility of a mesh's vertices."""
    if normals is None:
        normals = vertex_normals(vertices_mm, caster.triangles)
    towards = camera.centre_mm - vertices_mm
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    cosine = (towards * normals).sum(axis=1)
    visible = cosine > min_cosine
    visible[visible] = caster.visible(camera, vertices_mm[visible], tolerance_mm)
    return Sight(camera.project(vertices_mm), visible, cosine)


def warp_to(
    caster: RayCaster,
    camera: Camera,
    source_px: np.ndarray,
    source_visible: np.ndarray,
    stride_px: int = 2,
) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel of a camera comes from in another picture, through the mesh.

    Args:
        caster: of the mesh as it stands before `camera`.
        source_px: (V, 2) of the vertices in the other picture.
        source_visible: (V,) bool in the other picture.
        stride_px: rays are cast at every such pixel; between them the map is bilinear.

    Returns:
        (map (h, w, 2) float32 pixels, mask (h, w) bool).
    """
    small = camera.resized(1.0 / stride_px)
    hits = caster.see(small)
    corners = caster.triangles[np.maximum(hits.triangle, 0)]
    where = (source_px[corners] * hits.barycentric[..., None]).sum(axis=2)
    seen = hits.hit & source_visible[corners].all(axis=2)
    where = np.where(seen[..., None], where, 0).astype(np.float32)
    # spread the border outwards by one ray, so that bilinear values at it are not mixed with zero
    weight = seen.astype(np.float32)
    spread = cv2.blur(weight, (3, 3))
    around = cv2.blur(where, (3, 3)) / np.maximum(spread, 1e-6)[..., None]
    where = np.where(seen[..., None], where, around)
    size = (camera.width_px, camera.height_px)
    full = cv2.resize(where, size, interpolation=cv2.INTER_LINEAR)
    mask = cv2.resize(weight, size, interpolation=cv2.INTER_LINEAR) > 0.6
    return full, mask


class FlowMatcher:
    """Dense flow between normalised pictures (DIS, Kroeger et al. 2016), with its agreement."""

    def __init__(self, finest_scale: int = 0, window_px: int = 9, variational: int = 0):
        self._flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._flow.setFinestScale(finest_scale)
        self._flow.setVariationalRefinementIterations(variational)
        self.window_px = window_px

    def flow(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """(h, w, 2) with a(x) ~ b(x + flow(x)); pictures (h, w) uint8."""
        return self._flow.calc(np.ascontiguousarray(a), np.ascontiguousarray(b), None)

    def agreement(self, a: np.ndarray, b: np.ndarray, flow: np.ndarray, mask: np.ndarray):
        """Local normalised correlation (h, w) of a(x) and b(x + flow) inside a mask."""
        height, width = a.shape
        x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
        there = cv2.remap(
            b.astype(np.float32), x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR
        )
        weight = mask.astype(np.float32)
        a, b = (a.astype(np.float32) - 128) * weight, (there - 128) * weight
        mean = [self._blur(p) for p in (weight, a, b, a * a, b * b, a * b)]
        count = np.maximum(mean[0], 1e-3)
        ma, mb, aa, bb, ab = (m / count for m in mean[1:])
        # an agreement of flat areas means nothing: a floor of some grey levels is added
        variance = np.sqrt(np.maximum(aa - ma**2, 0) * np.maximum(bb - mb**2, 0)) + 25.0
        return np.where(mask, (ab - ma * mb) / variance, 0.0).astype(np.float32)

    def _blur(self, picture):
        return cv2.blur(picture, (self.window_px, self.window_px))


def measure_motion(
    matcher: FlowMatcher,
    caster: RayCaster,
    seen: Sight,
    view: View,
    reference: View,
    reference_sight: Sight,
    *,
    stride_px: int = 2,
    min_agreement: float = 0.4,
) -> Motion:
    """Flow from the picture predicted out of `reference` to the real `view`, at the vertices.

    Args:
        caster: of the mesh as it is thought to stand in the view.
        seen: of `view.camera`, the same mesh.
        reference, reference_sight: another picture of the same surface (another frame or camera).
    """
    where, mask = warp_to(
        caster, view.camera, reference_sight.pixels, reference_sight.visible, stride_px
    )
    predicted = cv2.remap(
        reference.normalised,
        where[..., 0] - 0.5,
        where[..., 1] - 0.5,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    predicted = np.where(mask, predicted, view.normalised)
    flow = matcher.flow(predicted, view.normalised)
    agreement = matcher.agreement(predicted, view.normalised, flow, mask)
    at = sample(np.dstack([flow, agreement, mask.astype(np.float32)]), seen.pixels)
    usable = seen.visible & reference_sight.visible & (at[:, 3] > 0.9)
    weight = np.clip((at[:, 2] - min_agreement) / (1 - min_agreement), 0, 1)
    weight = weight * np.clip(seen.cosine, 0, 1)
    return Motion(at[:, :2].astype(np.float64), np.where(usable, weight, 0.0))
