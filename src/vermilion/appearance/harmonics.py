"""Light on a Lambertian surface: nine spherical harmonics of its normal (Ramamoorthi 2001)."""

from __future__ import annotations

import numpy as np

_FLOOR = 0.02  # share of the mean light


def harmonics(normals: np.ndarray) -> np.ndarray:
    """Harmonics (..., 9) of unit normals (..., 3): 1, y, z, x, xy, yz, 3zz - 1, xz, xx - yy.

    Unscaled: the coefficients of the light absorb the constants.
    """
    x, y, z = np.moveaxis(normals, -1, 0)
    terms = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    return np.stack(terms, axis=-1)


def harmonics_jacobian(normals: np.ndarray) -> np.ndarray:
    """Derivative (..., 9, 3) of `harmonics` by `normals` (..., 3)."""
    x, y, z = np.moveaxis(normals, -1, 0)
    o, i = np.zeros_like(x), np.ones_like(x)
    rows = [
        [o, o, o], [o, i, o], [o, o, i], [i, o, o], [y, x, o], [o, z, y],
        [o, o, 6 * z], [z, o, x], [2 * x, -2 * y, o],
    ]  # fmt: skip
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def irradiance(normals: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Light (..., 3), linear RGB, on a white surface with unit `normals` (..., 3).

    `light` (9, 3) are coefficients, or (..., 9, 3) those that reach each normal's place. Values have a
    positive floor, because others divide by them.
    """
    if light.ndim == 2:
        return lit(harmonics(normals), light)
    found = (harmonics(normals)[..., None, :] @ light)[..., 0, :]
    return np.maximum(found, _FLOOR * np.abs(light[..., 0, :]))


def lit(basis: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Light (..., 3) of `light` (9, 3) where its harmonics are `basis` (..., 9), with that floor."""
    return np.maximum(basis @ light, _FLOOR * np.abs(light[0]))
