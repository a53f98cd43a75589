"""Rotations and rotation vectors, batched, stable at no turn and near half a turn.

The logarithm goes over the unit quaternion (Shepperd 1978 for the branch), which loses no digits
at either end; half a turn maps to one of its two equal logarithms.
"""

from __future__ import annotations

import numpy as np

_SMALL = 1e-4  # radians under which the series is exact to rounding


def rotation_vector(rotations: np.ndarray) -> np.ndarray:
    """Logarithm: axis times angle, (..., 3) rad with length in [0, pi], of rotations (..., 3, 3)."""
    quaternion = unit_quaternion(rotations)
    w, imaginary = quaternion[..., 0], quaternion[..., 1:]
    sine = np.linalg.norm(imaginary, axis=-1)
    angle = 2.0 * np.arctan2(sine, w)
    with np.errstate(divide="ignore", invalid="ignore"):
        # sin(a/2) -> a: the factor tends to 2 / w (1 - t^2 / 3), t the tangent of the half angle.
        series = 2.0 / w * (1.0 - (sine / w) ** 2 / 3.0)
        factor = np.where(sine > _SMALL, angle / sine, series)
    return factor[..., None] * imaginary


def unit_quaternion(rotations: np.ndarray) -> np.ndarray:
    """(w, x, y, z) with w >= 0, (..., 4), of rotations (..., 3, 3)."""
    r = np.asarray(rotations, dtype=np.float64)
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    # Each row is one component's square times four, then its products with the other three.
    wx, wy, wz = (
        r[..., 2, 1] - r[..., 1, 2],
        r[..., 0, 2] - r[..., 2, 0],
        r[..., 1, 0] - r[..., 0, 1],
    )
    xy, xz, yz = (
        r[..., 0, 1] + r[..., 1, 0],
        r[..., 0, 2] + r[..., 2, 0],
        r[..., 1, 2] + r[..., 2, 1],
    )
    candidates = np.stack(
        [
            np.stack([1 + xx + yy + zz, wx, wy, wz], axis=-1),
            np.stack([wx, 1 + xx - yy - zz, xy, xz], axis=-1),
            np.stack([wy, xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([wz, xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    diagonal = np.stack([candidates[..., k, k] for k in range(4)], axis=-1)
    best = np.argmax(diagonal, axis=-1)[..., None, None]
    chosen = np.take_along_axis(candidates, best, axis=-2)[..., 0, :]
    chosen = chosen / np.linalg.norm(chosen, axis=-1, keepdims=True)
    return np.where(chosen[..., :1] < 0, -chosen, chosen)


def rotation_matrix(vectors: np.ndarray) -> np.ndarray:
    """Exponential: rotations (..., 3, 3) of rotation vectors (..., 3) rad (Rodrigues)."""
    vectors = np.asarray(vectors, dtype=np.float64)
    angle = np.linalg.norm(vectors, axis=-1)
    half = np.sinc(angle / (2 * np.pi))  # sin(a/2) / (a/2)
    first = np.sinc(angle / np.pi)[..., None, None]
    second = (0.5 * half**2)[..., None, None]
    cross = cross_matrix(vectors)
    return np.eye(3) + first * cross + second * (cross @ cross)


def cross_matrix(vectors: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) with [v] w = v x w, of vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    flat = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    return flat.reshape(*vectors.shape[:-1], 3, 3)


def left_jacobian(vectors: np.ndarray) -> np.ndarray:
    """J with exp(v + dv) = exp(J dv) exp(v), (..., 3, 3), of rotation vectors (..., 3) rad."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    k = cross_matrix(vectors)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    b = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + a * k + b * (k @ k)


def nearest_rotation(matrices: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) nearest to matrices (..., 3, 3), by singular values (Arun et al. 1987)."""
    u, _, vt = np.linalg.svd(matrices)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt


def mean_rotation(rotations: np.ndarray) -> np.ndarray:
    """Chordal mean (3, 3) of rotations (F, 3, 3)."""
    return nearest_rotation(rotations.mean(axis=0))


def log_about_mean(rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors about the mean: rotation = exp(vector) @ mean.

    Args:
        rotations: (M, 3, 3).

    Returns:
        vectors (M, 3) rad, mean (3, 3).
    """
    mean = mean_rotation(rotations)
    return rotation_vector(rotations @ mean.T), mean


def exp_about_mean(vectors: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """The inverse of `log_about_mean`: (..., 3, 3), of vectors (..., 3) rad and a mean (3, 3)."""
    return rotation_matrix(vectors) @ mean
