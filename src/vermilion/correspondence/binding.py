"""A registered mesh bound to the surface that it was registered to, without folds."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.mesh import Mesh, adjacency, triangle_normals, vertex_normals
from vermilion.geometry.surface_points import SurfaceMap, closest_on_surface

ROUNDS_A_RING = 10


def bind_vertices(
    registered: Mesh,
    accurate: Mesh,
    *,
    max_distance_mm: float,
    max_angle_deg: float,
    sides: np.ndarray | None = None,
    triangle_sides: np.ndarray | None = None,
    rounds: int = 100,
) -> tuple[SurfaceMap, np.ndarray]:
    """Bind every vertex to its closest compatible point; folds are relaxed along the surface.

    The closest points of neighbours can lie in another order than the neighbours themselves, above
    all where a lip turns inwards. The corners of such triangles, and by less the vertices about them,
    slide towards the middle of their neighbours' points, on the surface, until none faces the wrong
    way. Folds that do not open even when more and more of their surroundings move stay, and only what
    lies next to them has moved.

    Args:
        registered: near the accurate mesh.
        max_distance_mm: vertices further from their point are bound to nothing.
        max_angle_deg, sides, triangle_sides: see `closest_on_surface`.
        rounds: of relaxation at most.

    Returns:
        (map, distance (V,) mm between vertex and point, infinite if unbound).
    """
    normals = vertex_normals(registered.vertices_mm, registered.triangles)
    near = adjacency(registered.triangles, len(normals)).tocsr()
    found, distance = closest_on_surface(
        registered.vertices_mm,
        accurate,
        normals=normals,
        max_angle_deg=max_angle_deg,
        sides=sides,
        triangle_sides=triangle_sides,
    )
    triangle = np.where(distance <= max_distance_mm, found.triangle, -1)
    found = SurfaceMap(triangle, found.barycentric.copy())
    normals_there = vertex_normals(accurate.vertices_mm, accurate.triangles)
    local = found
    for index in range(rounds + 1):
        points = found.sample(accurate.vertices_mm, accurate.triangles)
        folded = flipped_triangles(found, registered.triangles, accurate)
        if not folded.any():
            break
        if index == ROUNDS_A_RING:
            local = SurfaceMap(found.triangle.copy(), found.barycentric.copy())
        if index == rounds:  # no room helps: what little was moved at first is kept
            found = local
            break
        pull = np.zeros(len(normals))
        pull[registered.triangles[folded]] = 0.5
        for _ in range(1 + index // ROUNDS_A_RING):  # stubborn folds need more room
            pull = np.maximum(pull, 0.5 * near.multiply(pull).max(axis=1).toarray().ravel())
        moving = np.flatnonzero((pull > 0) & found.bound)
        ring = near[moving]
        count = np.maximum(ring @ found.bound.astype(float), 1.0)
        middle = (ring @ np.nan_to_num(points)) / count[:, None]
        slid, _ = closest_on_surface(
            points[moving] + pull[moving, None] * (middle - points[moving]),
            accurate,
            normals=found.sample(normals_there, accurate.triangles)[moving],
            max_angle_deg=max_angle_deg,
            sides=None if sides is None else sides[moving],
            triangle_sides=triangle_sides,
        )
        kept = slid.bound
        found.triangle[moving[kept]] = slid.triangle[kept]
        found.barycentric[moving[kept]] = slid.barycentric[kept]
    points = found.sample(accurate.vertices_mm, accurate.triangles)
    distance = np.linalg.norm(points - registered.vertices_mm, axis=1)
    return found, np.where(found.bound, distance, np.inf)


def flipped_triangles(found: SurfaceMap, triangles: np.ndarray, accurate: Mesh) -> np.ndarray:
    """Triangles (T, 3) between bound points that face against the surface they lie on, (T,) bool.

    A triangle with an unbound corner has no side.
    """
    whole = found.bound[triangles].all(axis=1)
    points = np.nan_to_num(found.sample(accurate.vertices_mm, accurate.triangles))
    normals = vertex_normals(accurate.vertices_mm, accurate.triangles)
    there = np.nan_to_num(found.sample(normals, accurate.triangles))[triangles].sum(axis=1)
    return whole & ((triangle_normals(points, triangles) * there).sum(axis=1) <= 0)
