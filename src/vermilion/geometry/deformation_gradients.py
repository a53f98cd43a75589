"""Per-triangle deformation gradients with the phantom vertex of Sumner and Popovic 2004."""

from __future__ import annotations

import numpy as np


def triangle_frames(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Frames [v2 - v1, v3 - v1, n / sqrt|n|] of triangles as columns.

    The third column points to the phantom vertex; its length is the root of twice the area, so
    that a uniform scale of the triangle scales all three columns alike.

    Args:
        vertices: (..., V, 3), any unit and frame.
        triangles: (T, 3).

    Returns:
        (..., T, 3, 3).
    """
    first = vertices[..., triangles[:, 0], :]
    along = vertices[..., triangles[:, 1], :] - first
    across = vertices[..., triangles[:, 2], :] - first
    normal = np.cross(along, across)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    phantom = np.divide(normal, np.sqrt(length), out=np.zeros_like(normal), where=length > 0)
    return np.stack([along, across, phantom], axis=-1)


def inverse_3x3(matrices: np.ndarray) -> np.ndarray:
    """Inverses (..., 3, 3) of matrices (..., 3, 3) by cross products of the columns; NaN if singular."""
    a, b, c = (matrices[..., :, k] for k in range(3))
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
    determinant = (a * rows[..., 0, :]).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            np.abs(determinant)[..., None, None] > 1e-300,
            rows / determinant[..., None, None],
            np.nan,
        )


def deformation_gradients(
    source: np.ndarray, target: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Gradient of the map that takes each triangle of `source` to that of `target`.

    Args:
        source, target: (..., V, 3), one topology; leading axes broadcast.
        triangles: (T, 3).

    Returns:
        (..., T, 3, 3). The identity where the source triangle has no area.
    """
    inverse = inverse_3x3(triangle_frames(np.asarray(source, np.float64), triangles))
    gradients = triangle_frames(np.asarray(target, np.float64), triangles) @ inverse
    degenerate = np.isnan(gradients).any(axis=(-1, -2))
    gradients[degenerate] = np.eye(3)
    return gradients
