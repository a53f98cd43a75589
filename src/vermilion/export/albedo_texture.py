"""The skin's estimated albedo as a texture."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.imaging.draw import to_display


def albedo_texture(
    colours: np.ndarray, uv: np.ndarray, triangles: np.ndarray, size_px: int = 1024
) -> np.ndarray:
    """A square sRGB image (size_px, size_px, 3) uint8 of linear colours (V, 3).

    Args:
        colours: of the vertices, linear RGB.
        uv: (V, 2), v up.
        triangles: (T, 3).
        size_px: side of the image.

    Returns:
        the image; beyond the mesh's borders it repeats the nearest colour.
    """
    flat = np.concatenate([uv.astype(np.float64) * size_px, np.zeros((len(uv), 1))], axis=1)
    x, y = np.meshgrid(np.arange(size_px) + 0.5, size_px - 0.5 - np.arange(size_px))
    origins = np.stack([x, y, np.full_like(x, 10.0)], axis=-1)
    directions = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    hits = RayCaster(flat, triangles).cast(origins, np.ascontiguousarray(directions))
    image = interpolate(hits, triangles, colours)
    if not hits.hit.any():
        return np.full((size_px, size_px, 3), 128, dtype=np.uint8)
    rows, columns = distance_transform_edt(~hits.hit, return_distances=False, return_indices=True)
    return to_display(np.clip(image[rows, columns], 0.0, 1.0))
