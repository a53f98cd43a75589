"""Where the tattoo is: the neutral with it compared with the neutral without it, in texture space."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.imaging.images import linear_to_srgb
from vermilion.inpaint.bake import Texture
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import blur, fill_holes


def tattoo_mask(
    domain: LipDomain,
    tattooed: Texture,
    plain: Texture,
    reach_mm: float,
    sensitivity: float,
    closing_mm: float = 1.5,
) -> np.ndarray:
    """Texels to paint over, (h, w) bool: the vermilion and every coloured texel joined to it.

    Args:
        tattooed, plain: the neutral with and without the tattoo, from all cameras.
        reach_mm: no further from the vermilion than this.
        sensitivity: how many deviations of the skin's own difference count as tattoo.
        closing_mm: gaps of the pattern narrower than this are painted too.
    """
    known = tattooed.seen & plain.seen
    skin = known & (domain.lip_distance_mm > reach_mm) & ~domain.inner
    difference = _colour_difference(tattooed, plain, known, skin, 0.3 / domain.texel_mm)
    typical, spread = _robust_spread(difference[skin])
    coloured = known & (difference > typical + sensitivity * spread)
    coloured &= domain.lip_distance_mm <= reach_mm
    coloured = _opened(domain, _closed(domain, coloured, closing_mm), 0.4)
    vermilion = domain.valid & (domain.lip_distance_mm < 0.5 * domain.texel_mm)
    mask = _joined_to(coloured | vermilion, vermilion)
    # Inside the mouth, texels that one of the neutrals does not show continue those beside them.
    hidden = domain.valid & ~known
    continued = fill_holes(mask.astype(np.float32), known | vermilion) > 0.5
    mask = np.where(hidden, continued, mask) & domain.valid
    return _closed(domain, mask, closing_mm)


def feather_mask(
    domain: LipDomain, mask: np.ndarray, border_mm: float, feather_mm: float
) -> np.ndarray:
    """Opacity (h, w) float32: 1 up to `border_mm` outside a mask, then smoothly to 0.

    `mask` (h, w) bool.
    """
    outside = domain.distance_mm(mask, border_mm + feather_mm + 1.0)
    t = np.clip((outside - border_mm) / max(feather_mm, 1e-6), 0.0, 1.0)
    return np.where(domain.valid, 1.0 - t * t * (3.0 - 2.0 * t), 0.0).astype(np.float32)


def _colour_difference(
    tattooed: Texture, plain: Texture, known: np.ndarray, skin: np.ndarray, sigma: float
) -> np.ndarray:
    """Distance of display colours after one gain a channel, slightly smoothed, (h, w)."""
    use = skin if skin.sum() >= 100 else known
    gain = np.median(plain.rgb[use], axis=0) / np.maximum(
        np.median(tattooed.rgb[use], axis=0), 1e-4
    )
    colours = linear_to_srgb(tattooed.rgb * gain) - linear_to_srgb(plain.rgb)
    support = np.maximum(blur(known.astype(np.float32), sigma), 1e-3)
    smooth = blur(np.where(known[..., None], colours, 0), sigma) / support[..., None]
    return np.where(known, np.linalg.norm(smooth, axis=2), 0.0)


def _robust_spread(values: np.ndarray) -> tuple[float, float]:
    if len(values) < 100:
        return 0.0, 0.02
    typical = float(np.median(values))
    return typical, max(1.4826 * float(np.median(np.abs(values - typical))), 0.004)


def _closed(domain: LipDomain, mask: np.ndarray, radius_mm: float) -> np.ndarray:
    """Gaps narrower than twice the radius filled."""
    grown = domain.distance_mm(mask, radius_mm) <= radius_mm
    return domain.valid & (domain.distance_mm(~grown, radius_mm + 1.0) > radius_mm)


def _opened(domain: LipDomain, mask: np.ndarray, radius_mm: float) -> np.ndarray:
    """Parts narrower than twice the radius removed."""
    shrunk = domain.distance_mm(~mask, radius_mm + 1.0) > radius_mm
    return mask & (domain.distance_mm(shrunk & mask, radius_mm) <= radius_mm)


def _joined_to(mask: np.ndarray, seeds: np.ndarray) -> np.ndarray:
    """The connected parts of the mask that touch a seed."""
    _, part = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    wanted = np.unique(part[seeds & mask])
    return mask & np.isin(part, wanted[wanted > 0])
