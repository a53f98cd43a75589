"""Image motion between an image predicted through the mesh and the real one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import Hits, RayCaster
from vermilion.imaging.sampling import sample_bilinear
from vermilion.multiview.views import View

#: Cosine of a vertex that faces the camera; how far in front of a vertex the mesh may lie.
_MIN_COSINE, _TOLERANCE_MM = 0.15, 0.3


@dataclass(frozen=True)
class Sight:
    """What a camera sees of a mesh's vertices.

    Attributes:
        pixels: (V, 2) where they project.
        visible: (V,) bool: in the image, facing the camera, not hidden.
        cosine: (V,) of the angle between normal and viewing ray, positive when facing.
    """

    pixels: np.ndarray
    visible: np.ndarray
    cosine: np.ndarray


@dataclass(frozen=True)
class Motion:
    """Where a camera's image says the vertices are.

    Attributes:
        offset_px: (V, 2) from where they project now.
        weight: (V,) in [0, 1], zero where the camera does not see the vertex or the images
            disagree.
    """

    offset_px: np.ndarray
    weight: np.ndarray


def sight(
    caster: RayCaster,
    camera: Camera,
    vertices_mm: np.ndarray,
    normals: np.ndarray | None = None,
) -> Sight:
    """Project and test the visibility of a mesh's vertices.

    Args:
        caster: of the mesh.
        camera: in its world.
        vertices_mm: (V, 3) world, mm.
        normals: (V, 3) unit; None: they are found here.
    """
    if normals is None:
        normals = vertex_normals(vertices_mm, caster.triangles)
    towards = camera.centre_mm - vertices_mm
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    cosine = (towards * normals).sum(axis=1)
    visible = cosine > _MIN_COSINE
    visible[visible] = caster.visible(camera, vertices_mm[visible], _TOLERANCE_MM)
    return Sight(camera.project(vertices_mm), visible, cosine)


@dataclass(frozen=True)
class Raster:
    """The mesh as the pixels of a camera's window see it; shared by all that is predicted there.

    Attributes:
        left_px, top_px: where the window begins in the image.
        camera: of the window.
        corners: (h', w', 3) vertices of the triangle that each ray hits.
        hits: of one ray every few pixels.
    """

    left_px: int
    top_px: int
    camera: Camera
    corners: np.ndarray
    hits: Hits

    def cut(self, image: np.ndarray) -> np.ndarray:
        """The window (h', w') of an image (h, w)."""
        bottom, right = self.top_px + self.camera.height_px, self.left_px + self.camera.width_px
        return image[self.top_px : bottom, self.left_px : right]


def rasterise(
    caster: RayCaster, camera: Camera, seen: Sight, stride_px: int = 2, margin_px: int = 24
) -> Raster | None:
    """Cast rays at every `stride_px` pixel of the window where the mesh is; None if it is not.

    Args:
        caster: of the mesh.
        camera: a pinhole.
        seen: of that camera.
        margin_px: room round the visible vertices, for what moves.
    """
    if not seen.visible.any():
        return None
    size = np.array([camera.width_px, camera.height_px])
    pixels = seen.pixels[seen.visible]
    low = np.floor((pixels.min(axis=0) - margin_px) / stride_px).astype(int) * stride_px
    high = np.ceil((pixels.max(axis=0) + margin_px) / stride_px).astype(int) * stride_px
    low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    if (high - low).min() < 32:
        return None
    k = camera.calibration
    params = (k[0, 0], k[1, 1], k[0, 2] - low[0], k[1, 2] - low[1])
    width, height = (int(n) for n in high - low)
    window = Camera(camera.name, "PINHOLE", params, width, height, camera.cam_from_world)
    hits = caster.see(window.resized(1.0 / stride_px))
    corners = caster.triangles[np.maximum(hits.triangle, 0)]
    return Raster(int(low[0]), int(low[1]), window, corners, hits)


def warp_to(
    raster: Raster, source_px: np.ndarray, source_visible: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel of a window comes from in another image, through the mesh.

    Between rays the map is bilinear.

    Args:
        source_px: (V, 2) of the vertices in the other image.
        source_visible: (V,) bool in the other image.

    Returns:
        (map (h, w, 2) float32 pixels, mask (h, w) bool).
    """
    hits, corners = raster.hits, raster.corners
    where = np.einsum(
        "hwkc,hwk->hwc", source_px.astype(np.float32)[corners], hits.barycentric.astype(np.float32)
    )
    seen = hits.hit & source_visible[corners].all(axis=2)
    where = np.where(seen[..., None], where, np.float32(0))
    # spread the border outwards by one ray, so that bilinear values at it are not mixed with zero
    weight = seen.astype(np.float32)
    spread = cv2.blur(weight, (3, 3))
    around = cv2.blur(where, (3, 3)) / np.maximum(spread, 1e-6)[..., None]
    where = np.where(seen[..., None], where, around)
    size = (raster.camera.width_px, raster.camera.height_px)
    full = cv2.resize(where, size, interpolation=cv2.INTER_LINEAR)
    mask = cv2.resize(weight, size, interpolation=cv2.INTER_LINEAR) > 0.6
    return full, mask


class FlowMatcher:
    """Dense flow between normalised images (DIS, Kroeger et al. 2016), with its agreement."""

    def __init__(self, window_px: int = 9):
        """`window_px` is the width of the correlation that judges the flow.

        The flow goes down to full resolution, and without the variational refinement: its
        smoothness costs half of the accuracy on a tattoo (measured), and the mesh is the better
        regulariser.
        """
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._flow.setFinestScale(0)
        self._flow.setPatchStride(4)
        self._flow.setGradientDescentIterations(12)
        self._flow.setVariationalRefinementIterations(0)
        self.window_px = window_px

    def flow(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Flow (h, w, 2) px with a(x) ~ b(x + flow(x)), of a and b (h, w) uint8."""
        a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
        return self._flow.calc(a, b, None)  # type: ignore[call-overload] # the last may be None

    def agreement(
        self, a: np.ndarray, b: np.ndarray, flow: np.ndarray, mask: np.ndarray
    ) -> np.ndarray:
        """Local normalised correlation of a(x) and b(x + flow) inside a mask.

        Args:
            a, b: (h, w) uint8, locally normalised.
            flow: (h, w, 2) px.
            mask: (h, w) bool.

        Returns:
            (h, w) float32 in [-1, 1]; zero outside the mask.
        """
        there = _along(b.astype(np.float32), flow, cv2.BORDER_CONSTANT)
        weight = mask.astype(np.float32)
        a, b = (a.astype(np.float32) - 128) * weight, (there - 128) * weight
        mean = [self._blur(p) for p in (weight, a, b, a * a, b * b, a * b)]
        count = np.maximum(mean[0], 1e-3)
        ma, mb, aa, bb, ab = (m / count for m in mean[1:])
        # an agreement of flat areas means nothing: a floor of some grey levels is added
        variance = np.sqrt(np.maximum(aa - ma**2, 0) * np.maximum(bb - mb**2, 0)) + 25.0
        return np.where(mask, (ab - ma * mb) / variance, 0.0).astype(np.float32)

    def round_trip(self, flow: np.ndarray, back: np.ndarray) -> np.ndarray:
        """Distance (h, w) px by which flow (h, w, 2) and the flow back (h, w, 2) miss the start.

        What one image hides has no way back.
        """
        return np.linalg.norm(flow + _along(back, flow, cv2.BORDER_REPLICATE), axis=2)

    def _blur(self, image):
        return cv2.blur(image, (self.window_px, self.window_px))


def _along(image: np.ndarray, flow: np.ndarray, border: int) -> np.ndarray:
    """Values of an image (h, w[, c]) at each pixel + flow (h, w, 2)."""
    height, width = flow.shape[:2]
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    places = np.stack([x, y], axis=-1) + flow
    return cv2.remap(  # type: ignore[call-overload] # the stub wants a second map
        image, places, None, cv2.INTER_LINEAR, borderMode=border
    )


@dataclass(frozen=True)
class Comparison:
    """An image predicted through the mesh against the real one, in a window.

    Attributes:
        raster: of the window.
        predicted, real: (h, w) uint8, locally normalised; `predicted` is `real` outside the mask.
        mask: (h, w) bool, where there is a prediction.
        flow: (h, w, 2) from the predicted to the real image, px.
        agreement: (h, w) local correlation after the flow.
    """

    raster: Raster
    predicted: np.ndarray
    real: np.ndarray
    mask: np.ndarray
    flow: np.ndarray
    agreement: np.ndarray


def compare(
    matcher: FlowMatcher, raster: Raster, view: View, reference: View, reference_sight: Sight
) -> Comparison:
    """Carry the image of `reference` through the mesh to `view`, and find what moved there.

    Args:
        raster: of the mesh as it is thought to stand in the view.
        reference, reference_sight: another image of the same surface (another frame or camera).
    """
    where, mask = warp_to(raster, reference_sight.pixels, reference_sight.visible)
    real = raster.cut(view.normalised)
    predicted = np.where(mask, sample_bilinear(reference.normalised, where), real)
    flow = matcher.flow(predicted, real)
    agreement = matcher.agreement(predicted, real, flow, mask)
    return Comparison(raster, predicted, real, mask, flow, agreement)


def motion_at(
    found: Comparison, seen: Sight, reference_sight: Sight, min_agreement: float = 0.4
) -> Motion:
    """The flow of a comparison at the vertices that both images see."""
    inside = seen.pixels - [found.raster.left_px, found.raster.top_px]
    stack = np.dstack([found.flow, found.agreement, found.mask.astype(np.float32)])
    at = sample_bilinear(stack, inside)
    usable = seen.visible & reference_sight.visible & (at[:, 3] > 0.9)
    weight = np.clip((at[:, 2] - min_agreement) / (1 - min_agreement), 0, 1)
    weight = weight * np.clip(seen.cosine, 0, 1)
    return Motion(at[:, :2].astype(np.float64), np.where(usable, weight, 0.0))


def measure_motion(
    matcher: FlowMatcher,
    raster: Raster | None,
    seen: Sight,
    view: View,
    reference: View,
    reference_sight: Sight,
    *,
    min_agreement: float = 0.4,
) -> Motion:
    """Flow from the image predicted out of `reference` to the real `view`, at the vertices.

    Args:
        raster: of the mesh as it is thought to stand in the view; None where it is not seen.
        seen: of `view.camera`, the same mesh.
        reference, reference_sight: another image of the same surface (another frame or camera).
    """
    if raster is None:
        return Motion(np.zeros_like(seen.pixels), np.zeros(len(seen.pixels)))
    found = compare(matcher, raster, view, reference, reference_sight)
    return motion_at(found, seen, reference_sight, min_agreement)
