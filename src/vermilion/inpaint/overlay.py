"""Images of what the inpainting did."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.imaging.draw import label, tile, to_display
from vermilion.inpaint.bake import Texture


def before_after(frame: int, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The window of one frame before and after, one above the other, (h, w, 3) uint8.

    `before` and `after` (h, w, 3) uint8, of the same size.
    """
    size = (max(1, round(before.shape[1] * (240 / before.shape[0]))), 240)
    pair = [cv2.resize(image, size, interpolation=cv2.INTER_CUBIC) for image in (before, after)]
    return np.vstack([label(pair[0], f"{frame}"), pair[1]])


def texture_sheet(
    plain: Texture, tattooed: Texture | None = None, opacity: np.ndarray | None = None
) -> np.ndarray:
    """Textures and the painted region, `opacity` (h, w), side by side, (H, W, 3) uint8."""
    tiles = [label(to_display(plain.rgb), "plain")]
    if tattooed is not None:
        tiles.append(label(to_display(tattooed.rgb), "tattooed"))
    if opacity is not None:
        grey = np.rint(np.clip(opacity, 0, 1) * 255).astype(np.uint8)
        tiles.append(label(np.repeat(grey[..., None], 3, axis=2), "painted"))
    seen = np.where(plain.seen, 255, 0).astype(np.uint8)
    tiles.append(label(np.repeat(seen[..., None], 3, axis=2), "seen"))
    return tile(tiles, len(tiles))
