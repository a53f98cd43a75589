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
    Window,
    composite,
    render_layer,
    softened,
    window_of,
)
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import fill_holes, luminance, weighted_blur
from vermilion.inpaint.grain import add_grain, missing_grain
from vermilion.inpaint.opening import Evidence, Opening, find_opening
from vermilion.inpaint.seam import seam_gain
from vermilion.inpaint.shading import Shading, bare_skin, change_ratio, equalised, under_reference


@dataclass(frozen=True)
class Paint:
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
        gap_mm: skin closer than this to the painted region is not trusted to be bare.
        evidence: how the image is asked where the mouth opens.
    """

    domain: LipDomain
    plain: Texture
    reference: Texture
    opacity: np.ndarray
    shading: Shading
    edge_mm: float = 0.8
    lens_px: float = 0.4
    rim_px: float = 1.0
    samples: int = 3
    grain: bool = True
    gap_mm: float = 1.0
    evidence: Evidence = field(default_factory=Evidence)

    @cached_property
    def bare(self) -> np.ndarray:
        """(h, w) bool, skin that surely has no tattoo, seen in the plain take."""
        return bare_skin(self.domain, self.opacity, self.gap_mm) & self.plain.seen

    @cached_property
    def base(self) -> np.ndarray:
        """(h, w, 3) the plain texture under the light of the reference pose."""
        return under_reference(self.domain, self.plain, self.reference, self.bare, self.shading)

    @cached_property
    def tattooed(self) -> np.ndarray:
        """(h, w, 3) the tattoo under the light of the reference pose, continued where unseen."""
        return fill_holes(self.reference.rgb, self.reference.seen)

    @cached_property
    def unpainted(self) -> np.ndarray:
        """(h, w) float32, 1 on all skin that is not painted."""
        return bare_skin(self.domain, self.opacity, 0.0).astype(np.float32)


@dataclass(frozen=True)
class Painted:
    """A frame without its tattoo.

    Attributes:
        linear: (h, w, 3) float32, the whole image.
        window: the rectangle that was worked on.
        composited_px: pixels painted at more than half.
        border_levels: mean colour difference between the painted texture and the image on the
            bare skin next to the border, in levels of 8 bit display colour.
    """

    linear: np.ndarray
    window: Window
    composited_px: int
    border_levels: float


def paint_frame(
    paint: Paint,
    linear: np.ndarray,
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    seed: tuple[int, ...],
) -> Painted | None:
    """Paint the lips of one image; None where they lie outside of it.

    Args:
        linear: (h, w, 3) image of `camera`.
        vertices_mm: (V, 3) of H at this frame.
        seed: of the noise.
    """
    domain = paint.domain
    window = window_of(domain, camera, vertices_mm, triangles, margin_px=8)
    if window is None:
        return None
    caster = RayCaster(vertices_mm, triangles)
    frame = bake(domain, vertices_mm, triangles, [(camera, linear)], paint.edge_mm)
    texture = equalised(domain, paint.base, paint.reference, frame, paint.bare, paint.shading)
    opening = _opening(paint, caster, camera, linear, vertices_mm, window)
    layer = render_layer(
        domain, texture, paint.opacity, caster, camera, window, paint.samples, opening
    )
    layer = softened(layer, paint.lens_px)
    darkest = _darkest(paint)
    layer = _shaded_at_seam(paint, layer, opening, frame, linear, caster, camera)
    result = composite(linear, layer, paint.rim_px, darkest)
    # The same rendering on the bare skin, to compare with the image.
    skin = render_layer(domain, texture, paint.unpainted, caster, camera, window, paint.samples)
    only_skin = skin.opacity > 0.99
    patch = linear[window.slices]
    rendered = softened(skin, paint.lens_px).rgb
    if paint.grain:
        lacking = missing_grain(patch, rendered, only_skin)
        result[window.slices] = add_grain(result[window.slices], layer.opacity, lacking, seed)
    near = only_skin & _within(layer.opacity, 4.0)
    return Painted(
        result,
        window,
        int((layer.opacity > 0.5).sum()),
        _colour_levels(patch, rendered, only_skin, near),
    )


def _opening(
    paint: Paint,
    caster: RayCaster,
    camera: Camera,
    linear: np.ndarray,
    vertices_mm: np.ndarray,
    window: Window,
) -> Opening | None:
    """The mouth opening that the image shows; None where the lips are too small or hidden."""
    ends = camera.project(vertices_mm[paint.domain.corners])
    length = np.linalg.norm(ends[1] - ends[0])
    if not np.isfinite(length) or length < 8.0:
        return None
    low = np.array([window.x, window.y])
    return find_opening(
        paint.domain,
        caster,
        camera,
        linear,
        (ends[1] - ends[0]) / length,
        (low, low + np.array([window.width, window.height])),
        _pixel_mm(camera, vertices_mm[paint.domain.corners]),
        paint.evidence,
    )


def _shaded_at_seam(
    paint: Paint,
    layer: Layer,
    opening: Opening | None,
    frame: Texture,
    linear: np.ndarray,
    caster: RayCaster,
    camera: Camera,
) -> Layer:
    """The layer with the shading that the image shows next to where the lips meet."""
    shading = paint.shading
    if opening is None or shading.mode != "ratio" or shading.seam_mm <= 0:
        return layer
    change = change_ratio(paint.domain, paint.reference, frame, shading)[..., None]
    tattooed = render_layer(
        paint.domain, paint.tattooed * change, paint.opacity, caster, camera, layer.window,
        paint.samples, opening,
    )  # fmt: skip
    gain = seam_gain(
        opening,
        softened(tattooed, paint.lens_px),
        linear,
        shading.seam_mm / opening.pixel_mm,
        shading.seam_along_mm / opening.pixel_mm,
    )
    return replace(layer, rgb=layer.rgb * gain[..., None])


def _darkest(paint: Paint) -> float:
    """Luminance that the painted lips hardly ever fall below, half of the darkest hundredth."""
    lips = paint.reference.seen & (paint.opacity > 0.99)
    return (
        0.5 * float(np.percentile(luminance(paint.reference.rgb[lips]), 1)) if lips.any() else 0.0
    )


def _pixel_mm(camera: Camera, points_mm: np.ndarray) -> float:
    """Size of a pixel on the lips."""
    return float(np.median(camera.to_camera(points_mm)[:, 2]) / camera.calibration[0, 0])


def _within(opacity: np.ndarray, distance_px: float) -> np.ndarray:
    return weighted_blur(opacity, np.ones_like(opacity), distance_px / 2)[0] > 0.01


def _colour_levels(
    image: np.ndarray, rendered: np.ndarray, known: np.ndarray, where: np.ndarray
) -> float:
    if not where.any():
        return 0.0
    difference = linear_to_srgb(rendered) - linear_to_srgb(image)
    smooth, _ = weighted_blur(difference, known.astype(np.float32), 2.0)
    return float(np.abs(smooth[where]).mean() * 255)
