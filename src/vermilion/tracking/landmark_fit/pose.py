"""The pose of known 3D points from their images, in closed form."""

from __future__ import annotations

import numpy as np


def scaled_orthographic_pose(
    points_mm: np.ndarray, image: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scaled orthographic pose of each frame (Mono13 6.2, closed form).

    Args:
        points_mm: (F, N, 3) in the head frame.
        image: (F, N, 2) pixels from the principal point, x right, y down.
        weights: (F, N) >= 0; at least four positive a frame.

    Returns:
        rotation (F, 3, 3) camera from head, scale (F,) pixels a millimetre, and the image
        translation (F, 2): image ~ scale * (rotation @ x)[:2] + translation.
    """
    total = weights.sum(axis=1, keepdims=True)
    w = weights / total
    point_mean = np.einsum("fn,fnk->fk", w, points_mm)
    image_mean = np.einsum("fn,fnk->fk", w, image)
    p, q = points_mm - point_mean[:, None], image - image_mean[:, None]
    left = np.einsum("fn,fni,fnj->fij", w, p, p)
    # A planar set leaves depth open: a whiff of isotropy keeps the inverse finite.
    left += 1e-6 * np.trace(left, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    affine = np.einsum("fn,fni,fnj->fij", w, q, p) @ np.linalg.inv(left)
    u, s, vt = np.linalg.svd(affine, full_matrices=False)
    rows = u @ vt
    scale = s.mean(axis=1)
    third = np.cross(rows[:, 0], rows[:, 1])
    rotation = np.concatenate([rows, third[:, None]], axis=1)
    translation = image_mean - scale[:, None] * np.einsum("fij,fj->fi", rows, point_mean)
    return rotation, scale, translation
