"""How much of a distant light reaches each point of a mesh: the mesh itself hides parts of it.

The light is nine harmonics of irradiance (`harmonics`). What is hidden of its radiance changes them from
place to place, linearly: a matrix of nine by nine a point, the identity where nothing is hidden.
"""

from __future__ import annotations

import numpy as np

from vermilion.appearance.harmonics import harmonics
from vermilion.geometry.raycast import RayCaster
from vermilion.geometry.sphere import sphere_points

#: Irradiance over radiance of each harmonic (Ramamoorthi 2001): of order 0, 1 and 2.
_COSINE = np.array([np.pi] + [2 * np.pi / 3] * 3 + [np.pi / 4] * 5)
#: Integral of the square of each harmonic over the sphere.
_NORM = 4 * np.pi * np.array([1, 1 / 3, 1 / 3, 1 / 3, 1 / 15, 1 / 15, 4 / 5, 1 / 15, 4 / 15])
_OFFSET_MM = 0.3  # rays start this far off the surface


def light_transfer(
    caster: RayCaster,
    points_mm: np.ndarray,
    normals: np.ndarray,
    world_to_camera: np.ndarray,
    n_directions: int = 128,
) -> np.ndarray:
    """Matrices (N, 9, 9) from the light's harmonics to those of what reaches each point.

    Directions below a point's own horizon count as free: the cosine leaves them out already.

    Args:
        caster: of the mesh, world.
        points_mm: (N, 3) on the mesh, world.
        normals: (N, 3) unit, world.
        world_to_camera: (3, 3) rotation; the harmonics are in the camera frame.
        n_directions: rays over the sphere.
    """
    directions = sphere_points(n_directions)
    world = directions @ world_to_camera
    point, ray = np.nonzero(normals @ world.T > 0.0)
    origins = points_mm[point] + _OFFSET_MM * normals[point]
    hidden = np.zeros((len(points_mm), n_directions))
    hidden[point, ray] = caster.occluded(origins, world[ray])
    basis = harmonics(directions)
    products = (basis[:, :, None] * basis[:, None, :]).reshape(n_directions, 81)
    lost = (hidden @ products).reshape(-1, 9, 9) * (4 * np.pi / n_directions)
    return np.eye(9) - lost * (_COSINE / _NORM)[:, None] / _COSINE
