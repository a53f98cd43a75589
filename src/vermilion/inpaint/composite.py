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
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


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
    """The rectangle that the domain's vertices project into; None where outside the image."""
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


def render_layer(
    domain: LipDomain,
    texture: np.ndarray,
    opacity: np.ndarray,
    caster: RayCaster,
    camera: Camera,
    window: Window,
    samples: int = 3,
    opening: Opening | None = None,
) -> Layer:
    """Render a texture (h, w, 3) and its opacity (h, w), `samples` squared rays a pixel.

    Where an `opening` is given, it decides what is lip and what is open between the corners of the
    mouth; where the mesh has no lip, the colour of the lip beside is continued.
    """
    size = (window.height * samples, window.width * samples)
    x, y = np.meshgrid(np.arange(size[1]) + 0.5, np.arange(size[0]) + 0.5)
    pixels = np.stack([x, y], axis=-1) / samples + [window.x, window.y]
    hits = caster.cast(*camera.rays(pixels))
    triangle = np.maximum(hits.triangle, 0)
    on_domain = hits.hit & domain.in_domain[triangle]
    corners = caster.triangles[triangle]
    texel = (domain.texel_of_vertex[corners] * hits.barycentric[..., None]).sum(axis=-2)
    alpha = np.where(on_domain, sample(opacity, texel), 0.0)
    colour = sample(texture, texel) * alpha[..., None]
    # The mouth's inside and the background; bare skin outside the domain stays as it is.
    outside = ~hits.hit | (~on_domain & ~domain.skin[triangle])
    if opening is not None:
        inner = outside | (on_domain & (sample(domain.inner.astype(np.float32), texel) > 0.5))
        alpha, colour, outside = _opened(opening, pixels, inner, outside, alpha, colour)
    shrink = (window.width, window.height)
    return Layer(
        window,
        cv2.resize(colour.astype(np.float32), shrink, interpolation=cv2.INTER_AREA),
        cv2.resize(alpha.astype(np.float32), shrink, interpolation=cv2.INTER_AREA),
        cv2.resize(outside.astype(np.float32), shrink, interpolation=cv2.INTER_AREA),
    )


def _opened(
    opening: Opening,
    pixels: np.ndarray,
    inner: np.ndarray,
    outside: np.ndarray,
    alpha: np.ndarray,
    colour: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Opacity, colour and what is open, with the opening that the image shows for the mesh's."""
    open_here, near = opening.inside(pixels), opening.near(pixels)
    lacking = near & inner & ~open_here
    painted = (alpha > 0.99) & ~inner & ~open_here
    if lacking.any() and painted.any():
        colour = np.where(lacking[..., None], fill_holes(colour, painted), colour)
        alpha = np.where(lacking, 1.0, alpha)
    alpha = np.where(open_here, 0.0, alpha)
    colour = np.where(open_here[..., None], 0.0, colour)
    return alpha, colour, np.where(near & inner, open_here, outside | open_here)


def softened(layer: Layer, sigma_px: float) -> Layer:
    """The layer seen through a lens: a Gaussian of `sigma_px`."""
    if sigma_px <= 0:
        return layer
    edge = int(np.ceil(3 * sigma_px))
    opened = cv2.copyMakeBorder(layer.open, *[edge] * 4, cv2.BORDER_REPLICATE)
    return replace(
        layer,
        rgb=blur(layer.rgb, sigma_px),
        opacity=blur(layer.opacity, sigma_px),
        open=blur(opened, sigma_px)[edge:-edge, edge:-edge],
    )


def composite(linear: np.ndarray, layer: Layer, rim_px: float, darkest: float = 0.0) -> np.ndarray:
    """A copy of an image (h, w, 3), linear, with the layer painted over it.

    Pixels without skin (mouth opening, teeth, background) keep their colour, except within `rim_px`
    of the painted lips, where the lens mixed the tattoo into them: there the colour of the pure
    pixels behind is continued. Where the opening is too narrow for pure pixels, those count that are
    darker than the lips ever are (luminance `darkest`).
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
