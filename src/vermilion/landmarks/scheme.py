"""The 66-point scheme: the 68 points of iBUG 300-W without separate inner mouth corners.

"Left" and "right" below are the image's: point 0 lies at the subject's right ear.
"""

from __future__ import annotations

import numpy as np

N_LANDMARKS = 66

JAW = np.arange(0, 17)
BROWS = np.arange(17, 27)
NOSE = np.arange(27, 36)
EYE_RIGHT = np.arange(36, 42)  # the subject's right eye, on the left of the image
EYE_LEFT = np.arange(42, 48)
LIP_OUTER = np.array([58, 48, 49, 50, 51, 52, 62, 53, 54, 55, 56, 57])  # closed loop
LIP_INNER = np.arange(58, 66)  # closed loop; 58 and 62 are the mouth corners
LIP_INNER_OPEN = np.array([59, 60, 61, 63, 64, 65])  # the inner contour but for the corners
LIP_OUTER_FACING = np.array([49, 50, 51, 54, 55, 56])  # across the lip from each of these
MOUTH = np.arange(48, 66)
EYE_CORNERS = np.array([36, 45])  # the outer corners

#: Point k of the scheme is point FROM_68[k] of the 68-point one.
FROM_68 = np.concatenate(
    [np.arange(48), np.arange(49, 54), np.arange(55, 60), [48], [61, 62, 63], [54], [65, 66, 67]]
)

#: Point k of a mirrored image is point MIRROR[k] of the image.
MIRROR = np.concatenate(
    [
        np.arange(16, -1, -1),
        np.arange(26, 16, -1),
        np.arange(27, 31),
        np.arange(35, 30, -1),
        [45, 44, 43, 42, 47, 46],
        [39, 38, 37, 36, 41, 40],
        np.arange(52, 47, -1),
        np.arange(57, 52, -1),
        [62, 61, 60, 59, 58, 65, 64, 63],
    ]
)


def interocular_px(points_px: np.ndarray) -> np.ndarray:
    """Distance of the outer eye corners, of points (..., 66, 2): (...,) in pixels."""
    corners = points_px[..., EYE_CORNERS, :]
    return np.linalg.norm(corners[..., 0, :] - corners[..., 1, :], axis=-1)


def face_size_px(points_px: np.ndarray) -> np.ndarray:
    """Root of the bounding box's area, of points (..., 66, 2): (...,) in pixels.

    Unlike the inter-ocular distance it does not shrink when the head turns.
    """
    extent = points_px.max(axis=-2) - points_px.min(axis=-2)
    return np.sqrt(np.prod(np.maximum(extent, 1e-6), axis=-1))
