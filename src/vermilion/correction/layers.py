"""Deformation gradients as nine numbers that interpolate linearly (Lips16 4.2).

A layer entry is [rx, ry, rz, sxx - 1, syy - 1, szz - 1, sxy, sxz, syz]: the logarithm (radians) of
the rotation Q and the symmetric stretch S, less the identity, of the polar decomposition G = Q S
(Higham 1986; Alexa et al. 2002). No correction is nine zeros.
"""

from __future__ import annotations

import math

import numpy as np

from vermilion.geometry.deformation_gradients import deformation_gradients
from vermilion.geometry.rotations import nearest_rotation, rotation_matrix, rotation_vector
from vermilion.storage.kernels import kernel

_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def encode_gradients(gradients: np.ndarray) -> np.ndarray:
    """Nine numbers (..., 9) float64 of deformation `gradients` (..., 3, 3)."""
    rotations, stretches = polar_decomposition(gradients)
    layers = np.empty((*gradients.shape[:-2], 9))
    layers[..., :3] = rotation_vector(rotations)
    layers[..., 3:] = stretches[..., _ROWS, _COLUMNS]
    layers[..., 3:6] -= 1.0
    return layers


def decode_layers(layers: np.ndarray) -> np.ndarray:
    """Deformation gradients (..., 3, 3) float64 of `layers` (..., 9): the exact inverse."""
    layers = np.asarray(layers, dtype=np.float64)
    if layers.shape[-1] != 9:
        raise ValueError(f"layers must be (..., 9), got {layers.shape}")
    stretches = np.empty((*layers.shape[:-1], 3, 3))
    stretches[..., _ROWS, _COLUMNS] = layers[..., 3:]
    stretches[..., _COLUMNS, _ROWS] = layers[..., 3:]
    diagonal = np.arange(3)
    stretches[..., diagonal, diagonal] += 1.0
    return rotation_matrix(layers[..., :3]) @ stretches


def correction_layers(
    coarse: np.ndarray, accurate: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Layers that turn each triangle of `coarse` into that of `accurate`, (F, T, 9) float64.

    Args:
        coarse, accurate: (F, V, 3), one topology, both in the head's canonical frame.
        triangles: (T, 3), those of the mask.
    """
    return encode_gradients(deformation_gradients(coarse, accurate, triangles))


def polar_decomposition(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G = Q S of `matrices` G (..., 3, 3): Q a rotation, S symmetric, both (..., 3, 3) float64.

    Where G turns a triangle inside out (negative determinant) or is singular, Q is the nearest
    rotation and S has a negative or zero eigenvalue; the product is G all the same.
    """
    flat = np.ascontiguousarray(matrices, dtype=np.float64).reshape(-1, 3, 3)
    rotations = np.empty_like(flat)
    regular = np.zeros(len(flat), dtype=np.bool_)
    _newton_polar(flat, rotations, regular)
    if not regular.all():
        rotations[~regular] = nearest_rotation(flat[~regular])
    stretches = np.swapaxes(rotations, -1, -2) @ flat
    stretches = 0.5 * (stretches + np.swapaxes(stretches, -1, -2))
    return rotations.reshape(matrices.shape), stretches.reshape(matrices.shape)


@kernel(nogil=True)
def _newton_polar(matrices, rotations, regular):
    """Higham's scaled Newton iteration; leaves `regular` False where it does not apply."""
    inverse = np.empty((3, 3))
    for index in range(matrices.shape[0]):
        x = rotations[index]
        # numba compiles an assignment of arrays for seconds: it may have to say what fails.
        for i in range(3):
            for c in range(3):
                x[i, c] = matrices[index, i, c]
        for step in range(30):
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                for c in range(3):
                    d, e = (c + 1) % 3, (c + 2) % 3
                    inverse[i, c] = x[j, d] * x[k, e] - x[j, e] * x[k, d]
            determinant = (
                x[0, 0] * inverse[0, 0] + x[0, 1] * inverse[0, 1] + x[0, 2] * inverse[0, 2]
            )
            if not determinant > 1e-9:
                break
            norm_x = norm_inverse = 0.0
            for i in range(3):
                for c in range(3):
                    inverse[i, c] /= determinant
                    norm_x += x[i, c] ** 2
                    norm_inverse += inverse[i, c] ** 2
            scale = math.sqrt(math.sqrt(norm_inverse / norm_x)) if step < 4 else 1.0
            change = 0.0
            for i in range(3):
                for c in range(3):
                    value = 0.5 * (scale * x[i, c] + inverse[i, c] / scale)
                    change += (value - x[i, c]) ** 2
                    x[i, c] = value
            if change < 1e-26:
                regular[index] = True
                break
