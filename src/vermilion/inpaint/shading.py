"""Shading equalisation: the plain texture as it looks in one frame (Lips16 3.2.1).

The paper takes the pixel-wise intensity difference of the lip region between a frame and a
reference pose and adds it to the plain texture. Here the difference is low-passed, so that what the
mesh misses of the tattoo's motion does not leak, and it is taken of log intensity: the
tattoo reflects more or less light than the lips do, and only ratios are free of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.inpaint.bake import Texture
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import fill_holes, luminance, weighted_blur

_SUPPORT = 0.05  # of a Gaussian's mass; less does not carry a mean


@dataclass(frozen=True)
class Shading:
    """How strongly, and over which lengths, shading is carried over.

    Attributes:
        mode: `ratio` (log intensity), `difference` (intensity, as the paper writes) or `none`.
        sigma_mm: low-pass of the change between a frame and the reference.
        border_mm: low-pass of the match to the skin round the painted region.
        limit: largest gain, and its inverse the smallest.
    """

    mode: str = "ratio"
    sigma_mm: float = 2.0
    border_mm: float = 2.0
    limit: float = 2.5


def equalised(
    domain: LipDomain,
    plain: Texture,
    reference: Texture,
    frame: Texture,
    opacity: np.ndarray,
    shading: Shading,
) -> np.ndarray:
    """The plain texture under a frame's light, (h, w, 3) float32 linear, everywhere filled.

    Args:
        plain: without the tattoo, from all cameras.
        reference: the tattooed neutral in the painted camera.
        frame: the frame in the same camera.
        opacity: (h, w) where it will be painted; 0 is bare skin, which calibrates the colours.
    """
    base = fill_holes(plain.rgb, plain.seen)
    bare = (opacity <= 0) & domain.valid & ~domain.inner
    # 1. The plain take against the reference pose, known on the bare skin round the lips.
    base = base * _skin_gain(domain, base, reference, bare & plain.seen, shading, wide=True)
    # 2. The change from the reference pose to this frame.
    if shading.mode == "ratio":
        base = base * change_ratio(domain, reference, frame, shading)[..., None]
    elif shading.mode == "difference":
        base = np.maximum(base + change_difference(domain, reference, frame, shading), 0.0)
    # 3. What is left at the border, faded out towards the middle of the lips.
    return base * _skin_gain(domain, base, frame, bare & plain.seen, shading, wide=False)


def change_ratio(
    domain: LipDomain, reference: Texture, frame: Texture, shading: Shading
) -> np.ndarray:
    """Low-passed luminance of the frame over that of the reference, (h, w)."""
    weights = np.minimum(frame.weight, reference.weight)
    sigma = shading.sigma_mm / domain.texel_mm
    now, support = weighted_blur(luminance(frame.rgb), weights, sigma)
    then, _ = weighted_blur(luminance(reference.rgb), weights, sigma)
    ratio = np.clip(now / np.maximum(then, 1e-4), 1.0 / shading.limit, shading.limit)
    return fill_holes(ratio, support > _SUPPORT * weights.max(), sigma)


def change_difference(
    domain: LipDomain, reference: Texture, frame: Texture, shading: Shading
) -> np.ndarray:
    """Low-passed colour of the frame minus that of the reference, (h, w, 3)."""
    weights = np.minimum(frame.weight, reference.weight)
    sigma = shading.sigma_mm / domain.texel_mm
    change, support = weighted_blur(frame.rgb - reference.rgb, weights, sigma)
    return fill_holes(change, support > _SUPPORT * weights.max(), sigma)


def _skin_gain(
    domain: LipDomain,
    base: np.ndarray,
    target: Texture,
    bare: np.ndarray,
    shading: Shading,
    wide: bool,
) -> np.ndarray:
    """Gain a channel, (h, w, 3), that brings `base` to the target's bare skin.

    `wide` continues the gain over the lips; otherwise it fades to 1 away from the bare skin.
    """
    weights = np.where(bare, target.weight, 0.0)
    if not weights.any():
        return np.ones_like(base)
    sigma = shading.border_mm / domain.texel_mm
    goal, support = weighted_blur(target.rgb, weights, sigma)
    have, _ = weighted_blur(base, weights, sigma)
    gain = np.clip(goal / np.maximum(have, 1e-4), 1.0 / shading.limit, shading.limit)
    enough = support > _SUPPORT * weights.max()
    if wide:
        return fill_holes(gain, enough, 2 * sigma)
    fade = np.clip(support / max(0.4 * float(weights.max()), 1e-9), 0.0, 1.0)[..., None]
    return np.where(enough[..., None], 1.0 + (gain - 1.0) * fade, 1.0)
