"""Images of a correspondence, to be looked at once a subject."""

from __future__ import annotations

import numpy as np

from vermilion.correspondence.correspondence import Correspondence
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.imaging.draw import colour_map, draw_mesh, draw_points, label, tile

SCALE_MM = 3.0


def correspondence_overlay(
    image: np.ndarray,
    camera: Camera,
    coarse_world: Mesh,
    accurate_world: Mesh,
    registered: Mesh,
    landmarks: tuple[SurfacePoints, SurfacePoints],
    correspondence: Correspondence,
) -> np.ndarray:
    """Four panels, (h, w, 3) uint8: both meshes' landmarks, the mask, the distances, H on C.

    Args:
        image: (h, w, 3) uint8 frontal image of the neutral.
        coarse_world, accurate_world: C and H of that frame, in the camera's world.
        registered: C laid over H, in H's world.
        landmarks: on C and on H.
    """
    on_coarse, on_accurate = (
        points.sample(mesh.vertices_mm, mesh.triangles)
        for points, mesh in zip(landmarks, (coarse_world, accurate_world), strict=True)
    )
    first = draw_mesh(image, camera, *_parts(coarse_world), opacity=0.35)
    first = draw_points(first, camera.project(on_coarse), (60, 160, 255), 3)
    first = draw_points(first, camera.project(on_accurate), (255, 70, 60), 2)
    in_mask = np.zeros(len(coarse_world.vertices_mm))
    np.add.at(in_mask, coarse_world.triangles[correspondence.mask], 1)
    colours = np.where(in_mask[:, None] > 0, [0.85, 0.3, 0.25], [0.75, 0.75, 0.75])
    colours[~correspondence.vertices.bound] = [0.2, 0.3, 0.8]
    second = draw_mesh(image, camera, *_parts(coarse_world), colours, 0.8)
    distance = np.where(correspondence.vertices.bound, correspondence.distance_mm, np.nan)
    third = draw_mesh(image, camera, *_parts(registered), colour_map(distance, 0.0, SCALE_MM), 0.9)
    bound = correspondence.on_coarse(accurate_world.vertices_mm)
    kept = correspondence.vertices.bound[coarse_world.triangles].all(axis=1)
    fourth = draw_mesh(
        image, camera, np.nan_to_num(bound), coarse_world.triangles[kept], opacity=1.0
    )
    panels = [
        label(first, "landmarks on C (blue) and H (red)"),
        label(second, "mask (red), no counterpart (blue)"),
        label(third, f"distance, 0 to {SCALE_MM:g} mm"),
        label(fourth, "H on the topology of C"),
    ]
    return tile(panels, 4)


def _parts(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices_mm, mesh.triangles
