"""Images of a head by ray casting: many cameras share one scene and one baking of the light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import Hits, RayCaster
from vermilion.studio import kernels
from vermilion.studio.lighting import Lighting, bake_light, light_directions
from vermilion.studio.look import Look, noise_volume
from vermilion.studio.surface import StudioSurface


@dataclass(frozen=True)
class Scene:
    """What stays the same through a take: the surface, how it looks, how it is lit.

    Attributes:
        triangles: (T, 3) int32 of the studio model.
        occlusion_directions, light_samples: rays of the baking (of the sky, of each light).
        edge_samples: rays a pixel where an edge crosses it.
    """

    triangles: np.ndarray
    surface: StudioSurface
    look: Look
    lighting: Lighting
    occlusion_directions: int = 192
    light_samples: int = 12
    edge_samples: int = 4


@dataclass(frozen=True)
class _View:
    """Primary rays of one camera: every pixel's middle, then the extra rays of edge pixels."""

    shape: tuple[int, int]
    directions: np.ndarray
    hits: Hits
    edge: np.ndarray
    edge_directions: np.ndarray
    edge_hits: Hits
    pixel_angle: float


def render(scene: Scene, vertices_mm: np.ndarray, cameras: dict[str, Camera]) -> dict:
    """Linear RGB images, name -> (h, w, 3) float32, of the head at `vertices_mm` (V, 3).

    The shading holds no randomness, and no camera's image depends on the others.
    """
    vertices = np.ascontiguousarray(vertices_mm, dtype=np.float64)
    caster = RayCaster(vertices, scene.triangles)
    normals = vertex_normals(vertices, scene.triangles)
    views = {name: _look_through(scene, caster, normals, cam) for name, cam in cameras.items()}
    # One more: the triangle of rays that hit nothing is -1.
    seen = np.zeros(len(scene.triangles) + 1, dtype=bool)
    for view in views.values():
        for hits in (view.hits, view.edge_hits):
            seen[hits.triangle.ravel()] = True
    needed = np.zeros(len(vertices), dtype=bool)
    needed[scene.triangles[seen[:-1]]] = True
    light = bake_light(
        caster,
        vertices,
        normals,
        np.flatnonzero(needed),
        scene.lighting,
        scene.occlusion_directions,
        scene.light_samples,
    )
    return {name: _image(scene, view, normals, light) for name, view in views.items()}


def _look_through(scene: Scene, caster: RayCaster, normals: np.ndarray, camera: Camera) -> _View:
    key = (camera.model, camera.params, camera.width_px, camera.height_px)
    origin = camera.centre_mm.astype(np.float32)
    directions = _world(_local_directions(*key, offset=(0.5, 0.5)), camera)
    hits = caster.cast(origin, directions)
    edge = _edges(scene, hits, normals)
    rows, columns = np.nonzero(edge)
    offsets = sample_offsets(scene.edge_samples)
    extra = np.stack(
        [_world(_local_directions(*key, offset=tuple(o))[rows, columns], camera) for o in offsets]
    )
    scale = camera.calibration[0, 0]
    extra_hits = caster.cast(origin, extra)
    return _View(directions.shape[:2], directions, hits, edge, extra, extra_hits, 1.0 / scale)


def _image(scene: Scene, view: _View, normals: np.ndarray, light) -> np.ndarray:
    image = _shaded(scene, view.directions, view.hits, normals, light, view.pixel_angle)
    if view.edge.any():
        samples = _shaded(
            scene, view.edge_directions, view.edge_hits, normals, light, view.pixel_angle
        )
        image[view.edge] = samples.mean(axis=0)
    return image


def _shaded(scene: Scene, directions, hits: Hits, normals, light, pixel_angle) -> np.ndarray:
    surface, shape = scene.surface, hits.triangle.shape
    out = np.empty((hits.triangle.size, 3), dtype=np.float32)
    kernels.shade_hits(
        out,
        hits.triangle.reshape(-1),
        hits.barycentric.reshape(-1, 3),
        directions.reshape(-1, 3),
        hits.distance_mm.reshape(-1),
        pixel_angle,
        scene.triangles,
        surface.material,
        normals,
        surface.solid_mm,
        surface.lip_mm,
        surface.inside_mm,
        light.sky,
        light.visible,
        light_directions(scene.lighting),
        np.array([one.colour for one in scene.lighting.lights]),
        noise_volume(),
        scene.look,
        surface.brows_mm,
        surface.chin_mm,
        np.array(scene.lighting.background),
    )
    return out.reshape(*shape, 3)


def _edges(scene: Scene, hits: Hits, normals: np.ndarray) -> np.ndarray:
    """Pixels (h, w) bool across which the surface, its depth or its direction jumps."""
    triangle = hits.triangle
    first = scene.triangles[np.maximum(triangle, 0), 0]
    kind = np.where(triangle >= 0, scene.surface.material[np.maximum(triangle, 0)], 99)
    depth = np.where(triangle >= 0, hits.distance_mm, 1e6)
    normal = normals[first].astype(np.float32)
    edge = np.zeros(triangle.shape, dtype=bool)
    for axis in (0, 1):
        low = [slice(None), slice(None)]
        high = [slice(None), slice(None)]
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        a, b = tuple(low), tuple(high)
        jump = (kind[a] != kind[b]) | (np.abs(depth[a] - depth[b]) > 2.0)
        jump |= (normal[a] * normal[b]).sum(axis=-1) < 0.75
        edge[a] |= jump
        edge[b] |= jump
    return edge


def sample_offsets(count: int) -> np.ndarray:
    """Places of `count` rays in a pixel, (count, 2) in [0, 1): a rank-1 lattice."""
    index = np.arange(count)
    return np.stack([(index + 0.5) / count, (0.5 + index * 0.61803398875) % 1.0], axis=1)


@lru_cache(maxsize=64)
def _local_directions(model, params, width, height, offset) -> np.ndarray:
    """Unit directions (h, w, 3) float32 in the camera frame through a place in every pixel."""
    camera = Camera("", model, params, width, height, np.eye(3, 4))
    shift = np.array(offset) - 0.5
    _, directions = camera.rays(camera.pixel_grid() + shift)
    directions = directions.astype(np.float32)
    directions.flags.writeable = False
    return directions


def _world(local: np.ndarray, camera: Camera) -> np.ndarray:
    return local @ camera.rotation.astype(np.float32)
