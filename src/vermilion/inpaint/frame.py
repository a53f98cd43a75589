"""One frame without its tattoo (Lips16 3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import linear_to_srgb
from vermilion.inpaint.bake import Texture, bake
from vermilion.inpaint.composite import (
    Layer,
    Stencil,
    Window,
    blur_layer,
    cast_window,
    composite,
    render_layer,
    stencil_of,
    window_of,
)
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import fill_holes, luminance, weighted_blur
from vermilion.inpaint.grain import add_grain, missing_grain
from vermilion.inpaint.opening import MouthPlace, Opening, OpeningSettings
from vermilion.inpaint.opening_search import find_opening
from vermilion.inpaint.seam import seam_gain
from vermilion.inpaint.shading import (
    ShadingSettings,
    bare_skin,
    equalise_shading,
    relit_to_reference,
)


@dataclass(frozen=True)
class InpaintInputs:
    """All that does not change from frame to frame of a take.

    Attributes:
        domain: the lips in texture space.
        plain: texture without tattoo.
        reference: the tattooed neutral in the painted camera.
        opacity: (h, w) what is painted.
        shading: how shading is carried over.
        edge_mm: surface closer than this to an occluding contour is not sampled.
        lens_px: blur of the camera's lens.
        rim_px: how far that blur reaches into the mouth opening.
        samples: rays a pixel, a side.
        grain: match the image's noise.
        gap_mm: skin closer than this to the painted region may carry some tattoo.
        opening: how the mouth opening is found in the image.
    """

    domain: LipDomain
    plain: Texture
    reference: Texture
    opacity: np.ndarray
    shading: ShadingSettings
    edge_mm: float = 0.8
    lens_px: float = 0.4
    rim_px: float = 1.0
    samples: int = 3
    grain: bool = True
    gap_mm: float = 1.0
    opening: OpeningSettings = field(default_factory=OpeningSettings)

    @cached_property
    def bare(self) -> np.ndarray:
        """(h, w) bool, skin that surely has no tattoo, seen in the plain take."""
        return bare_skin(self.domain, self.opacity, self.gap_mm) & self.plain.seen

    @cached_property
    def base(self) -> np.ndarray:
        """(h, w, 3) the plain texture under the light of the reference pose."""
        return relit_to_reference(self.domain, self.plain, self.reference, self.bare, self.shading)

    @cached_property
    def tattooed(self) -> np.ndarray:
        """(h, w, 3) the tattoo under the light of the reference pose, continued where unseen."""
        return fill_holes(self.reference.rgb, self.reference.seen)

    @cached_property
    def unpainted(self) -> np.ndarray:
        """(h, w) float32, 1 on all skin that is not painted."""
        return bare_skin(self.domain, self.opacity, 0.0).astype(np.float32)

    @cached_property
    def darkest(self) -> float:
        """Luminance that no painted lip is likely to fall below: half of the first percentile."""
        lips = self.reference.seen & (self.opacity > 0.99)
        if not lips.any():
            return 0.0
        return 0.5 * float(np.percentile(luminance(self.reference.rgb[lips]), 1))


@dataclass(frozen=True)
class InpaintedFrame:
    """A frame without its tattoo.

    Attributes:
        linear: (h, w, 3) float32, the whole image.
        window: the rectangle that was worked on.
        before: (h, w, 3) float32, the window as it was, display colours in [0, 1].
        composited_px: pixels painted at more than half.
        border_levels: mean colour difference between the painted texture and the image on the
            bare skin next to the border, in levels of 8 bit display colour.
    """

    linear: np.ndarray
    window: Window
    before: np.ndarray
    composited_px: int
    border_levels: float


def inpaint_frame(
    inputs: InpaintInputs,
    linear: np.ndarray,
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    seed: tuple[int, ...],
) -> InpaintedFrame | None:
    """Paint the lips of one image; None where they lie outside of it.

    Args:
        inputs: of the take.
        linear: (h, w, 3) image of `camera`, linear RGB.
        camera: the painted one.
        vertices_mm: (V, 3) of H at this frame, world.
        triangles: (T, 3) of the template.
        seed: of the noise.
    """
    domain = inputs.domain
    window = window_of(domain, camera, vertices_mm, triangles, margin_px=8)
    if window is None:
        return None
    caster = RayCaster(vertices_mm, triangles)
    frame = bake(domain, caster, vertices_mm, [(camera, linear)], inputs.edge_mm)
    texture, change = equalise_shading(
        domain, inputs.base, inputs.reference, frame, inputs.bare, inputs.shading
    )
    opening = _opening(inputs, caster, camera, linear, vertices_mm, window)
    rays = cast_window(domain, caster, camera, window, inputs.samples)
    stencil = stencil_of(rays, inputs.opacity, opening)
    layer = blur_layer(render_layer(stencil, texture), inputs.lens_px)
    if opening is not None and inputs.shading.mode == "ratio" and inputs.shading.seam_mm > 0:
        layer = _shade_seam(inputs, layer, opening, stencil, change, linear)
    result = composite(linear, layer, inputs.rim_px, inputs.darkest)
    # The same rendering on the bare skin, to compare with the image.
    skin = render_layer(stencil_of(rays, inputs.unpainted), texture)
    only_skin = skin.opacity > 0.99
    rendered = blur_layer(skin, inputs.lens_px).rgb
    patch = linear[window.slices]
    if inputs.grain:
        lacking = missing_grain(patch, rendered, only_skin)
        result[window.slices] = add_grain(result[window.slices], layer.opacity, lacking, seed)
    before = linear_to_srgb(patch)
    levels = _border_levels(before, rendered, only_skin, layer.opacity)
    return InpaintedFrame(result, window, before, int((layer.opacity > 0.5).sum()), levels)


def _opening(
    inputs: InpaintInputs,
    caster: RayCaster,
    camera: Camera,
    linear: np.ndarray,
    vertices_mm: np.ndarray,
    window: Window,
) -> Opening | None:
    """The mouth opening that the image shows; None where the lips are too small or hidden."""
    corners_mm = vertices_mm[inputs.domain.corners]
    ends = camera.project(corners_mm)
    length = np.linalg.norm(ends[1] - ends[0])
    if not np.isfinite(length) or length < 8.0:
        return None
    low = np.array([window.x, window.y])
    high = low + np.array([window.width, window.height])
    place = MouthPlace((ends[1] - ends[0]) / length, low, high, _pixel_mm(camera, corners_mm))
    return find_opening(inputs.domain, caster, camera, linear, place, inputs.opening)


def _shade_seam(
    inputs: InpaintInputs,
    layer: Layer,
    opening: Opening,
    stencil: Stencil,
    change: np.ndarray,
    linear: np.ndarray,
) -> Layer:
    """The layer with the shading that the image shows next to where the lips meet.

    `change` (h, w) is the change of light from the reference pose to this frame.
    """
    tattooed = render_layer(stencil, inputs.tattooed * change[..., None])
    gain = seam_gain(
        opening,
        blur_layer(tattooed, inputs.lens_px),
        linear,
        inputs.shading.seam_mm / opening.pixel_mm,
        inputs.shading.seam_along_mm / opening.pixel_mm,
    )
    return replace(layer, rgb=layer.rgb * gain[..., None])


def _pixel_mm(camera: Camera, points_mm: np.ndarray) -> float:
    """Size of a pixel on the lips."""
    return float(np.median(camera.to_camera(points_mm)[:, 2]) / camera.calibration[0, 0])


def _border_levels(
    before: np.ndarray, rendered: np.ndarray, skin: np.ndarray, opacity: np.ndarray
) -> float:
    """`InpaintedFrame.border_levels` within about 4 px of what is painted.

    Args:
        before: (h, w, 3) the image, display colours.
        rendered: (h, w, 3) the texture rendered on the bare skin, linear.
        skin: (h, w) bool, pixels that show only bare skin.
        opacity: (h, w) of the layer.
    """
    near = skin & (weighted_blur(opacity, np.ones_like(opacity), 2.0)[0] > 0.01)
    if not near.any():
        return 0.0
    difference = linear_to_srgb(rendered) - before
    smooth, _ = weighted_blur(difference, skin.astype(np.float32), 2.0)
    return float(np.abs(smooth[near]).mean() * 255)
