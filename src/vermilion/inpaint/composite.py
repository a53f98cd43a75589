"""Rendering the painted texture through a mesh into a camera, and compositing it (Lips16 3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import blur, fill_holes, luminance, sample, weighted_blur
from vermilion.inpaint.opening import Opening


@dataclass(frozen=True)
class Window:
    """A rectangle of an image: left, top, width, height in pixels."""

    x: int
    y: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns of the window."""
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


@dataclass(frozen=True)
class WindowRays:
    """What the rays through a window meet on the mesh: cast once, used by every rendering.

    (H, W) is the window's size times `samples`.

    Attributes:
        domain: the lips in texture space.
        window: where.
        pixels: (H, W, 2) image place of each ray, px.
        texel: (H, W, 2) place in the texture.
        on_domain: (H, W) bool, the ray meets the domain.
        no_skin: (H, W) bool, the ray meets the inside of the mouth or the background.
    """

    domain: LipDomain
    window: Window
    pixels: np.ndarray
    texel: np.ndarray
    on_domain: np.ndarray
    no_skin: np.ndarray


@dataclass(frozen=True)
class Stencil:
    """What of a window is painted; any texture can be rendered through it.

    Attributes:
        rays: of the window.
        share: (H, W) opacity of the texture at each ray.
        blank: (H, W) bool, the mouth is open there.
        lacking: (H, W) bool, lips in the image where the mesh has none.
        known: (H, W) bool, rays whose colour is continued to `lacking`.
        opacity: (h, w) as `Layer.opacity`.
        open: (h, w) as `Layer.open`.
    """

    rays: WindowRays
    share: np.ndarray
    blank: np.ndarray
    lacking: np.ndarray
    known: np.ndarray
    opacity: np.ndarray
    open: np.ndarray


@dataclass(frozen=True)
class Layer:
    """What is painted into a window of an image.

    Attributes:
        window: where.
        rgb: (h, w, 3) float32 linear colour times opacity (premultiplied).
        opacity: (h, w) in [0, 1], share of the pixel that is painted.
        open: (h, w) in [0, 1], share of the pixel that shows no skin: mouth opening, background.
    """

    window: Window
    rgb: np.ndarray
    opacity: np.ndarray
    open: np.ndarray


def window_of(
    domain: LipDomain,
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    margin_px: int,
) -> Window | None:
    """The rectangle that the domain's vertices project into; None where outside the image.

    `vertices_mm` (V, 3) in the world, `triangles` (T, 3).
    """
    pixels = camera.project(vertices_mm[np.unique(triangles[domain.in_domain])])
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(pixels):
        return None
    low = np.floor(pixels.min(axis=0)).astype(int) - margin_px
    high = np.ceil(pixels.max(axis=0)).astype(int) + margin_px
    low, high = np.maximum(low, 0), np.minimum(high, [camera.width_px, camera.height_px])
    if (high - low < 4).any():
        return None
    return Window(int(low[0]), int(low[1]), *(int(n) for n in high - low))


def cast_window(
    domain: LipDomain, caster: RayCaster, camera: Camera, window: Window, samples: int
) -> WindowRays:
    """Cast the rays of a window, `samples` squared a pixel."""
    size = (window.height * samples, window.width * samples)
    x, y = np.meshgrid(np.arange(size[1]) + 0.5, np.arange(size[0]) + 0.5)
    pixels = np.stack([x, y], axis=-1) / samples + [window.x, window.y]
    hits = caster.cast(*camera.rays(pixels))
    triangle = np.maximum(hits.triangle, 0)
    on_domain = hits.hit & domain.in_domain[triangle]
    corners = caster.triangles[triangle]
    texel = (domain.texel_of_vertex[corners] * hits.barycentric[..., None]).sum(axis=-2)
    # Bare skin outside the domain stays as it is.
    no_skin = ~hits.hit | (~on_domain & ~domain.skin[triangle])
    return WindowRays(domain, window, pixels, texel, on_domain, no_skin)


def stencil_of(rays: WindowRays, opacity: np.ndarray, opening: Opening | None = None) -> Stencil:
    """The stencil of a texture's opacity (h, w).

    An `opening` decides what is lip and what is open between the corners of the mouth, whatever the
    mesh has there.
    """
    share = np.where(rays.on_domain, sample(opacity, rays.texel), 0.0)
    if opening is None:
        none = np.zeros_like(rays.on_domain)
        covered, opened = _shrunk(rays, share), _shrunk(rays, rays.no_skin)
        return Stencil(rays, share, none, none, none, covered, opened)
    on_inner = sample(rays.domain.inner.astype(np.float32), rays.texel) > 0.5
    inner = rays.no_skin | (rays.on_domain & on_inner)
    open_here, near = opening.inside_and_near(rays.pixels)
    lacking = near & inner & ~open_here
    known = (share > 0.99) & ~inner & ~open_here
    lacking = lacking & known.any()
    alpha = np.where(open_here, 0.0, np.where(lacking, 1.0, share))
    opened = np.where(near & inner, open_here, rays.no_skin | open_here)
    covered, opened = _shrunk(rays, alpha), _shrunk(rays, opened)
    return Stencil(rays, share, open_here, lacking, known, covered, opened)


def render_layer(stencil: Stencil, texture: np.ndarray) -> Layer:
    """A texture (h, w, 3), linear, rendered through a stencil.

    Where the mesh has no lip but the image does, the colour of the lip beside is continued.
    """
    colour = sample(texture, stencil.rays.texel) * stencil.share[..., None]
    if stencil.lacking.any():
        filled = fill_holes(colour, stencil.known)
        colour = np.where(stencil.lacking[..., None], filled, colour)
    colour = np.where(stencil.blank[..., None], 0.0, colour)
    rgb = _shrunk(stencil.rays, colour)
    return Layer(stencil.rays.window, rgb, stencil.opacity, stencil.open)


def _shrunk(rays: WindowRays, values: np.ndarray) -> np.ndarray:
    """Values (H, W[, c]) at the rays as means over pixels, (h, w[, c]) float32."""
    size = (rays.window.width, rays.window.height)
    return cv2.resize(values.astype(np.float32), size, interpolation=cv2.INTER_AREA)


def blur_layer(layer: Layer, sigma_px: float) -> Layer:
    """The layer as a lens blurs it: a Gaussian of `sigma_px`."""
    if sigma_px <= 0:
        return layer
    edge = int(np.ceil(3 * sigma_px))
    opened = cv2.copyMakeBorder(layer.open, edge, edge, edge, edge, cv2.BORDER_REPLICATE)
    return replace(
        layer,
        rgb=blur(layer.rgb, sigma_px),
        opacity=blur(layer.opacity, sigma_px),
        open=blur(opened, sigma_px)[edge:-edge, edge:-edge],
    )


def composite(linear: np.ndarray, layer: Layer, rim_px: float, darkest: float = 0.0) -> np.ndarray:
    """A copy of an image with a layer painted over it, (h, w, 3) float32.

    Pixels without skin (mouth opening, teeth, background) keep their colour, except within `rim_px`
    of the painted lips, where the lens mixed the tattoo into them: there the colour of the pure
    pixels behind is continued. Where the opening is too narrow for pure pixels, those count that are
    darker than the lips ever are (luminance `darkest`).

    Args:
        linear: (h, w, 3) the image, linear RGB.
        layer: what is painted.
        rim_px: how far the lens mixes the lips into what is beside them.
        darkest: luminance below which no lip is.
    """
    result = np.array(linear, dtype=np.float32)
    patch = result[layer.window.slices]
    behind = _behind(patch, layer, rim_px, darkest)
    opened = np.minimum(layer.open, 1.0 - layer.opacity)[..., None]
    bare = np.clip(1.0 - layer.opacity[..., None] - opened, 0.0, 1.0)
    result[layer.window.slices] = layer.rgb + bare * patch + opened * behind
    return result


def _behind(patch: np.ndarray, layer: Layer, rim_px: float, darkest: float) -> np.ndarray:
    """The colour of what lies behind the lips, (h, w, 3), as if the lips had not blurred into it."""
    painted = layer.opacity > 0.02
    if not painted.any():
        return patch
    distance = cv2.distanceTransform((~painted).astype(np.uint8), cv2.DIST_L2, 5)
    t = np.clip(distance / max(rim_px, 1e-6), 0.0, 1.0)
    # Where the opening is narrow no pixel is pure; the darkest are the least mixed.
    mixed_in = luminance(patch) / max(darkest, 1e-3)
    purity = layer.open * (t**3 + 1e-3 / (1.0 + mixed_in**2) ** 2)
    continued, support = weighted_blur(patch, purity, max(rim_px, 0.5))
    smooth = (t * t * (3.0 - 2.0 * t))[..., None]
    mixed = smooth * patch + (1.0 - smooth) * continued
    return np.where((support > 1e-9)[..., None] & (layer.open > 0)[..., None], mixed, patch)
