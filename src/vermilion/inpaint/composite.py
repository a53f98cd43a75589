"""Rendering the painted texture through a mesh into a camera, and compositing it (Lips16 3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vermilion.camera import Camera
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import blur, luminance, sample, weighted_blur
from vermilion.raycast import RayCaster


@dataclass(frozen=True)
class Window:
    """A rectangle of a picture: left, top, width, height in pixels."""

    x: int
    y: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


@dataclass(frozen=True)
class Layer:
    """What is painted into a window of a picture.

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
    """The rectangle that the domain's vertices project into; None where outside the picture."""
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
) -> Layer:
    """Render a texture (h, w, 3) and its opacity (h, w), `samples` squared rays a pixel."""
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
    shrink = (window.width, window.height)
    return Layer(
        window,
        cv2.resize(colour.astype(np.float32), shrink, interpolation=cv2.INTER_AREA),
        cv2.resize(alpha.astype(np.float32), shrink, interpolation=cv2.INTER_AREA),
        cv2.resize(outside.astype(np.float32), shrink, interpolation=cv2.INTER_AREA),
    )


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


def opened_by_darkness(layer: Layer, linear: np.ndarray, darkest: float, reach_px: float) -> Layer:
    """The layer without pixels that are too dark to be lips, next to the mouth opening.

    The mesh misses the inner contour by a fraction of a millimetre; the dark gap between the lips
    tells where it is.

    Args:
        linear: (h, w, 3) the whole picture.
        darkest: luminance that the tattooed lips hardly ever fall below.
        reach_px: how far from the opening of the mesh.
    """
    opening = layer.open > 0.5
    if not opening.any() or darkest <= 0:
        return layer
    grey = luminance(linear[layer.window.slices])
    distance = cv2.distanceTransform((~opening).astype(np.uint8), cv2.DIST_L2, 5)
    # Along the gap, towards the corners of the mouth, darkness is followed three times as far.
    gap = ((grey < darkest) & (distance <= 3.0 * reach_px)) | opening
    _, part = cv2.connectedComponents(gap.astype(np.uint8), connectivity=8)
    gap &= np.isin(part, np.unique(part[opening]))
    near = np.clip(1.5 - distance / max(reach_px, 1e-6), 0.0, 1.0)
    dark = np.clip(2.0 - grey / darkest, 0.0, 1.0) * np.maximum(near, gap & ~opening)
    # The pattern shows through where the lens mixed it with the gap; its contour is smooth.
    evidence = np.maximum(dark, layer.open).astype(np.float32)
    along = cv2.filter2D(evidence, -1, _kernel_along(opening), borderType=cv2.BORDER_REPLICATE)
    opened = np.clip(2.0 * (along - 0.5) + 0.6, 0.0, 1.0)
    keep = np.clip((1.0 - opened) / np.maximum(1.0 - layer.open, 1e-3), 0.0, 1.0)
    keep[_islands(layer.opacity * keep > 0.3)] = 0.0
    return replace(
        layer,
        rgb=layer.rgb * keep[..., None],
        opacity=layer.opacity * keep,
        open=np.minimum(layer.open + layer.opacity * (1.0 - keep), 1.0),
    )


def _islands(painted: np.ndarray, share: float = 0.03) -> np.ndarray:
    """Small parts of what is painted, cut off by the gap: they are no lips."""
    _, part, facts, _ = cv2.connectedComponentsWithStats(painted.astype(np.uint8), connectivity=8)
    small = facts[:, cv2.CC_STAT_AREA] < share * painted.sum()
    small[0] = False
    return small[part]


def _kernel_along(opening: np.ndarray, long_px: float = 2.0, short_px: float = 0.4) -> np.ndarray:
    """An elongated Gaussian along the main axis of a mask."""
    y, x = np.nonzero(opening)
    axis = np.array([1.0, 0.0])
    if len(x) > 10:
        axis = np.linalg.eigh(np.cov(np.stack([x, y])))[1][:, -1]
    offset = np.arange(-7, 8)
    dx, dy = np.meshgrid(offset, offset)
    u, v = dx * axis[0] + dy * axis[1], -dx * axis[1] + dy * axis[0]
    kernel = np.exp(-0.5 * ((u / long_px) ** 2 + (v / short_px) ** 2))
    return (kernel / kernel.sum()).astype(np.float32)


def composite(linear: np.ndarray, layer: Layer, rim_px: float, darkest: float = 0.0) -> np.ndarray:
    """A copy of a picture (h, w, 3), linear, with the layer painted over it.

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
