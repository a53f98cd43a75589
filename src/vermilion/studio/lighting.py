"""Area lights and a sky, and how much of them reaches each vertex: baked once a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.geometry.raycast import RayCaster
from vermilion.geometry.sphere import sphere_points
from vermilion.studio import light_kernels

#: Rays start this far off the surface (mm), so that a vertex does not shade itself.
OFFSET_MM = 0.12


@dataclass(frozen=True)
class AreaLight:
    """A disc that faces the head.

    Attributes:
        centre_mm: (3,) in the world.
        radius_mm: its size; the larger, the softer the shadows.
        colour: (3,) linear RGB light on a white surface that faces it, at the head.
    """

    centre_mm: tuple[float, float, float]
    radius_mm: float
    colour: tuple[float, float, float]


@dataclass(frozen=True)
class Lighting:
    """Lights, and a sky whose colour runs from below to above, and the wall behind the actor."""

    lights: tuple[AreaLight, ...]
    sky_above: tuple[float, float, float]
    sky_below: tuple[float, float, float]
    background: tuple[float, float, float]


LIGHTINGS = {
    "rig": Lighting(
        (
            AreaLight((-520.0, 260.0, 780.0), 170.0, (0.52, 0.50, 0.47)),
            AreaLight((520.0, 260.0, 780.0), 170.0, (0.44, 0.44, 0.44)),
            AreaLight((0.0, -420.0, 760.0), 200.0, (0.20, 0.20, 0.20)),
        ),
        sky_above=(0.50, 0.51, 0.53),
        sky_below=(0.22, 0.21, 0.20),
        background=(0.30, 0.31, 0.32),
    ),
    "room": Lighting(
        (
            AreaLight((430.0, 620.0, 620.0), 130.0, (0.74, 0.66, 0.54)),
            AreaLight((-760.0, 120.0, 420.0), 240.0, (0.26, 0.29, 0.34)),
        ),
        sky_above=(0.42, 0.41, 0.39),
        sky_below=(0.20, 0.18, 0.16),
        background=(0.17, 0.15, 0.13),
    ),
    "window": Lighting(
        (
            AreaLight((-800.0, 240.0, 480.0), 330.0, (0.88, 0.92, 1.00)),
            AreaLight((520.0, 80.0, 700.0), 260.0, (0.12, 0.11, 0.10)),
        ),
        sky_above=(0.30, 0.31, 0.34),
        sky_below=(0.17, 0.15, 0.13),
        background=(0.09, 0.10, 0.12),
    ),
}


@dataclass(frozen=True)
class BakedLight:
    """What reaches each vertex.

    Attributes:
        sky: (V, 3) float32 linear light of the sky, occlusion counted.
        visible: (V, L) float32 share of each light that is not shadowed.
    """

    sky: np.ndarray
    visible: np.ndarray


def light_directions(lighting: Lighting) -> np.ndarray:
    """Unit vectors from the head to the lights, (L, 3)."""
    centres = np.array([light.centre_mm for light in lighting.lights])
    return centres / np.linalg.norm(centres, axis=1, keepdims=True)


def bake_light(
    caster: RayCaster,
    vertices_mm: np.ndarray,
    normals: np.ndarray,
    needed: np.ndarray,
    lighting: Lighting,
    n_directions: int = 192,
    n_points: int = 12,
) -> BakedLight:
    """Ambient occlusion and soft shadows of some vertices; the others stay dark.

    The directions and the light points are the same for all vertices, so that neighbours differ
    smoothly. A vertex's light depends on no camera.

    Args:
        caster: of the mesh.
        vertices_mm: (V, 3) world.
        normals: (V, 3) unit.
        needed: (n,) ids of the vertices.
        lighting: lights and sky.
        n_directions: of the sky.
        n_points: on each light.
    """
    directions = sphere_points(n_directions)
    colours = _sky_colours(directions, lighting)
    sky = np.zeros((len(vertices_mm), 3), dtype=np.float32)
    visible = np.zeros((len(vertices_mm), len(lighting.lights)), dtype=np.float32)
    targets = np.stack([_disc_points(light, n_points) for light in lighting.lights])
    needed = np.asarray(needed, dtype=np.int64)
    for start in range(0, len(needed), 8192):
        part = needed[start : start + 8192]
        origins, rays, owner = _buffers(len(part) * n_directions)
        args = (vertices_mm, normals, part)
        count = light_kernels.sky_rays(*args, directions, OFFSET_MM, origins, rays, owner)
        blocked = caster.occluded(origins[:count], rays[:count])
        light_kernels.gather_sky(owner[:count], blocked, normals, directions, colours, sky)
        origins, rays, owner = _buffers(len(part) * targets.shape[0] * n_points)
        count = light_kernels.light_rays(*args, targets, OFFSET_MM, origins, rays, owner)
        free = ~caster.occluded(origins[:count], rays[:count])
        np.add.at(visible, (owner[:count][free, 0], owner[:count][free, 1]), 1.0 / n_points)
    return BakedLight(sky, visible)


def _buffers(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        np.empty((count, 3), dtype=np.float32),
        np.empty((count, 3), dtype=np.float32),
        np.empty((count, 2), dtype=np.int32),
    )


def _sky_colours(directions: np.ndarray, lighting: Lighting) -> np.ndarray:
    """Light of each direction, scaled so that an open sky gives its colour on a white surface."""
    height = (0.5 + 0.5 * directions[:, 1:2]) ** 1.0
    above, below = np.array(lighting.sky_above), np.array(lighting.sky_below)
    return (below + (above - below) * height) * (4.0 / len(directions))


def _disc_points(light: AreaLight, count: int) -> np.ndarray:
    centre = np.array(light.centre_mm)
    towards = -centre / np.linalg.norm(centre)
    across = np.cross(towards, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    index = np.arange(count) + 0.5
    radius = light.radius_mm * np.sqrt(index / count)
    angle = np.pi * (3.0 - np.sqrt(5.0)) * index
    up = np.cross(across, towards)
    return centre + radius[:, None] * (
        np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * up
    )
