"""Rotations, and the pose of known 3D points from their images."""

from __future__ import annotations

import numpy as np


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) with [v] w = v x w, of vectors (..., 3)."""
    x, y, z = np.moveaxis(v, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_of(vectors: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) of rotation vectors (..., 3) in radians (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    k = cross_matrix(vectors)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle**2 / 6, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + a * k + b * (k @ k)


def vector_of(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) of rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    flat = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_rotvec()
    return flat.reshape(*rotations.shape[:-2], 3)


def left_jacobian(vectors: np.ndarray) -> np.ndarray:
    """Left Jacobian J (..., 3, 3) of `vectors` (..., 3): exp(v + dv) = exp(J dv) exp(v)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    k = cross_matrix(vectors)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    b = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + a * k + b * (k @ k)


def nearest_rotation(matrices: np.ndarray) -> np.ndarray:
    """The rotations nearest to matrices (..., 3, 3), by singular values (Arun et al. 1987)."""
    u, _, vt = np.linalg.svd(matrices)
    flip = np.ones((*matrices.shape[:-2], 3))
    flip[..., 2] = np.sign(np.linalg.det(u @ vt))
    return (u * flip[..., None, :]) @ vt


def mean_rotation(rotations: np.ndarray) -> np.ndarray:
    """Chordal mean (3, 3) of rotations (F, 3, 3)."""
    return nearest_rotation(rotations.mean(axis=0))


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
