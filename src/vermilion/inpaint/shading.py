"""Shading equalisation: the plain texture as it looks in one frame (Lips16 3.2.1).

The paper takes the pixel-wise intensity difference of the lip region between a frame and a reference
pose and adds it to the plain texture. Here the difference is low-passed: motion of the tattoo that the
mesh misses would leak through otherwise. And it is a difference of log intensity: the tattoo reflects
more or less light than the lips, and only ratios do not depend on that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.inpaint.bake import Texture
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import blur, fill_holes, luminance, weighted_blur

_SUPPORT = 0.05  # of a Gaussian's mass; less does not carry a mean


@dataclass(frozen=True)
class ShadingSettings:
    """How strongly, and over which lengths, shading is carried over.

    Attributes:
        mode: `ratio` (log intensity), `difference` (intensity, as the paper writes) or `none`.
        sigma_mm: low-pass of the change between a frame and the reference.
        border_mm: low-pass of the match to the skin round the painted region.
        limit: largest gain, and its inverse the smallest.
        seam_mm: how far from the inner contours shading is read along them (`ratio` only; 0: not).
        seam_along_mm: Gaussian average along the contours.
    """

    mode: str = "ratio"
    sigma_mm: float = 2.0
    border_mm: float = 2.0
    limit: float = 2.5
    seam_mm: float = 1.0
    seam_along_mm: float = 4.0


def relit_to_reference(
    domain: LipDomain,
    plain: Texture,
    reference: Texture,
    bare: np.ndarray,
    settings: ShadingSettings,
) -> np.ndarray:
    """The plain texture under the light of the reference pose, (h, w, 3), everywhere filled.

    The two takes are compared on the bare skin round the lips.

    Args:
        domain: the lips in texture space.
        plain: without the tattoo, from all cameras.
        reference: the tattooed neutral in the painted camera.
        bare: (h, w) bool, skin that surely has no tattoo.
        settings: how shading is carried over.
    """
    base = fill_holes(plain.rgb, plain.seen)
    return base * skin_gain(domain, base, reference, bare & plain.seen, settings)


def equalise_shading(
    domain: LipDomain,
    base: np.ndarray,
    reference: Texture,
    frame: Texture,
    bare: np.ndarray,
    settings: ShadingSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """The plain texture under a frame's light (Lips16 3.2.1, shading equalisation).

    Args:
        domain: the lips in texture space.
        base: (h, w, 3) from `relit_to_reference`.
        reference: the tattooed neutral in the painted camera.
        frame: the frame in the same camera.
        bare: (h, w) bool, skin seen without tattoo in all of them.
        settings: how shading is carried over.

    Returns:
        (texture (h, w, 3) float32 linear, change of light from the reference to the frame (h, w),
        1 everywhere but in mode `ratio`).
    """
    change = np.ones(domain.shape, dtype=np.float32)
    if settings.mode == "ratio":
        change = change_ratio(domain, reference, frame, settings)
        base = base * change[..., None]
    elif settings.mode == "difference":
        base = np.maximum(base + change_difference(domain, reference, frame, settings), 0.0)
    # What differs at the border is faded out towards the middle of the lips.
    return base * border_gain(domain, base, frame, bare, settings)[..., None], change


def bare_skin(domain: LipDomain, opacity: np.ndarray, gap_mm: float) -> np.ndarray:
    """Texels of the outer face at least `gap_mm` away from what is painted, (h, w) bool.

    `opacity` (h, w) of what is painted.
    """
    away = domain.distance_mm(opacity > 0, gap_mm + 1.0)
    return (away > gap_mm) & domain.valid & ~domain.inner


def change_ratio(
    domain: LipDomain, reference: Texture, frame: Texture, settings: ShadingSettings
) -> np.ndarray:
    """Low-passed luminance of the frame over that of the reference, (h, w)."""
    weights = np.minimum(frame.weight, reference.weight)
    if not weights.any():
        return np.ones(domain.shape, dtype=np.float32)
    sigma = settings.sigma_mm / domain.texel_mm
    now, then = luminance(frame.rgb), luminance(reference.rgb)
    ratio, enough = _ratio(now, then, weights, sigma, settings.limit)
    return fill_holes(ratio, enough, sigma)


def change_difference(
    domain: LipDomain, reference: Texture, frame: Texture, settings: ShadingSettings
) -> np.ndarray:
    """Low-passed colour of the frame minus that of the reference, (h, w, 3)."""
    weights = np.minimum(frame.weight, reference.weight)
    sigma = settings.sigma_mm / domain.texel_mm
    change, support = weighted_blur(frame.rgb - reference.rgb, weights, sigma)
    return fill_holes(change, support > _SUPPORT * weights.max(), sigma)


def skin_gain(
    domain: LipDomain,
    base: np.ndarray,
    target: Texture,
    bare: np.ndarray,
    settings: ShadingSettings,
) -> np.ndarray:
    """Gain a channel, (h, w, 3), that brings a texture to the target's bare skin.

    It is continued inwards: the light's colour and strength may differ between the two takes, but
    vary slowly over the skin. `base` (h, w, 3) linear, `bare` (h, w) bool.
    """
    weights = np.where(bare, target.weight, 0.0)
    if not weights.any():
        return np.ones_like(base)
    sigma = 2.0 * settings.border_mm / domain.texel_mm
    gain, enough = _ratio(target.rgb, base, weights, sigma, settings.limit)
    return fill_holes(gain, enough, sigma)


def border_gain(
    domain: LipDomain,
    base: np.ndarray,
    target: Texture,
    bare: np.ndarray,
    settings: ShadingSettings,
) -> np.ndarray:
    """Gain of luminance (h, w) at the border of the painted region, 1 in the middle of the lips.

    `base` (h, w, 3) linear, `bare` (h, w) bool.
    """
    weights = np.where(bare, target.weight, 0.0)
    if not weights.any():
        return np.ones(domain.shape, dtype=np.float32)
    sigma = settings.border_mm / domain.texel_mm
    gain, enough = _ratio(luminance(target.rgb), luminance(base), weights, sigma, settings.limit)
    support = blur(weights, sigma) / float(weights.max())
    return np.where(enough, 1.0 + (gain - 1.0) * np.clip(support / 0.4, 0.0, 1.0), 1.0)


def _ratio(
    goal: np.ndarray, have: np.ndarray, weights: np.ndarray, sigma: float, limit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Ratio of two low-passed images within 1/limit and limit, and where it is supported."""
    above, support = weighted_blur(goal, weights, sigma)
    below, _ = weighted_blur(have, weights, sigma)
    ratio = np.clip(above / np.maximum(below, 1e-4), 1.0 / limit, limit)
    return ratio, support > _SUPPORT * weights.max()
