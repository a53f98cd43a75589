"""Images of what the inpainting did."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from vermilion.imaging.draw import label, tile, to_display
from vermilion.inpaint.bake import Texture
from vermilion.inpaint.paint import Painted


def before_after(
    frame: int, linear: np.ndarray, painted: Painted, height_px: int = 240
) -> np.ndarray:
    """The window of one frame before and after, one above the other, (h, w, 3) uint8."""
    pair = [to_display(image[painted.window.slices]) for image in (linear, painted.linear)]
    scale = height_px / pair[0].shape[0]
    size = (max(1, round(pair[0].shape[1] * scale)), height_px)
    pair = [cv2.resize(image, size, interpolation=cv2.INTER_CUBIC) for image in pair]
    return np.vstack([label(pair[0], f"{frame}"), pair[1]])


def sheet(tiles: Sequence[np.ndarray], columns: int = 4) -> np.ndarray:
    """Tiles side by side; a note where there are none."""
    if not tiles:
        return label(np.full((60, 480, 3), 40, dtype=np.uint8), "no frame could be painted")
    return tile(tiles, columns)


def texture_sheet(
    plain: Texture, tattooed: Texture | None = None, opacity: np.ndarray | None = None
) -> np.ndarray:
    """Textures and the painted region side by side."""
    tiles = [label(to_display(plain.rgb), "plain")]
    if tattooed is not None:
        tiles.append(label(to_display(tattooed.rgb), "tattooed"))
    if opacity is not None:
        grey = np.rint(np.clip(opacity, 0, 1) * 255).astype(np.uint8)
        tiles.append(label(np.repeat(grey[..., None], 3, axis=2), "painted"))
    seen = np.where(plain.seen, 255, 0).astype(np.uint8)
    tiles.append(label(np.repeat(seen[..., None], 3, axis=2), "seen"))
    return tile(tiles, len(tiles))
