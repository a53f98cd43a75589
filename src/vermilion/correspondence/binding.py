"""A registered mesh bound to the surface that it was registered to, without folds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, adjacency, triangle_normals, vertex_normals
from vermilion.geometry.surface_points import SurfacePoints

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
) -> SurfacePoints:
    """Bind every vertex to its closest compatible point; folds are relaxed along the surface.

    The closest points of neighbours can lie in another order than the neighbours themselves, above
    all where a lip turns inwards. The corners of such triangles, and by less the vertices about them,
    slide towards the middle of their neighbours' points, on the surface, until none faces the wrong
    way. Folds that do not open even when more and more of their surroundings move stay, and only what
    lies next to them has moved.

    Args:
        registered: V vertices near the accurate mesh, mm.
        accurate: T triangles, in the same frame, mm.
        max_distance_mm: vertices further from their point are bound to nothing.
        max_angle_deg: between the normals of a vertex and of its triangle.
        sides, triangle_sides: (V,), (T,) lips, +1 upper, -1 lower, 0 neither; None: unknown.
        rounds: of relaxation at most.

    Returns:
        V points of the accurate mesh with their distance_mm to the registered vertices.
    """
    surface = Surface(accurate.vertices_mm, accurate.triangles)

    def search(rows: np.ndarray, points_mm: np.ndarray, normals: np.ndarray) -> SurfacePoints:
        cosine = np.cos(np.deg2rad(max_angle_deg))
        of_rows = None if sides is None else sides[rows]
        return surface.closest(points_mm, normals, cosine, of_rows, triangle_sides)

    vertices = registered.vertices_mm
    normals = vertex_normals(vertices, registered.triangles)
    found = search(np.arange(len(vertices)), vertices, normals).within(max_distance_mm)
    found = _without_folds(found, registered.triangles, accurate, search, rounds)
    distance = np.linalg.norm(
        found.sample(accurate.vertices_mm, accurate.triangles) - vertices, axis=1
    )
    return replace(found, distance_mm=np.where(found.bound, distance, np.inf))


def _without_folds(
    found: SurfacePoints,
    triangles: np.ndarray,
    accurate: Mesh,
    search: Callable[[np.ndarray, np.ndarray, np.ndarray], SurfacePoints],
    rounds: int,
) -> SurfacePoints:
    """Slide the corners of flipped triangles (T, 3), and what lies about them, on the surface.

    Args:
        search: compatible closest points of some rows, from their points and normals.
    """
    near = adjacency(triangles, len(found)).tocsr()
    normals = vertex_normals(accurate.vertices_mm, accurate.triangles)
    local = found
    for index in range(rounds):
        folded = flipped_triangles(found, triangles, accurate)
        if not folded.any():
            return found
        if index == ROUNDS_A_RING:
            local = found
        pull = np.zeros(len(found))
        pull[triangles[folded]] = 0.5
        for _ in range(1 + index // ROUNDS_A_RING):  # stubborn folds need more room
            pull = np.maximum(pull, 0.5 * near.multiply(pull).max(axis=1).toarray().ravel())
        moving = np.flatnonzero((pull > 0) & found.bound)
        ring = near[moving]
        points = found.sample(accurate.vertices_mm, accurate.triangles)
        count = np.maximum(ring @ found.bound.astype(float), 1.0)
        middle = (ring @ np.nan_to_num(points)) / count[:, None]
        step = pull[moving, None] * (middle - points[moving])
        slid = search(
            moving, points[moving] + step, found.sample(normals, accurate.triangles)[moving]
        )
        # A point that would end farther from its goal than it is now stays.
        slid = slid.restricted(slid.distance_mm <= np.linalg.norm(step, axis=1))
        triangle, barycentric = found.triangle.copy(), found.barycentric.copy()
        triangle[moving[slid.bound]] = slid.triangle[slid.bound]
        barycentric[moving[slid.bound]] = slid.barycentric[slid.bound]
        found = SurfacePoints(triangle, barycentric)
    # Where no room helps, what little was moved at first is kept.
    return local if flipped_triangles(found, triangles, accurate).any() else found


def flipped_triangles(found: SurfacePoints, triangles: np.ndarray, accurate: Mesh) -> np.ndarray:
    """Triangles between bound points that face against the surface they lie on.

    Args:
        found: V points of the accurate mesh.
        triangles: (T, 3) between them.
        accurate: the surface.

    Returns:
        (T,) bool; a triangle with an unbound corner has no side and does not count.
    """
    whole = found.bound[triangles].all(axis=1)
    points = np.nan_to_num(found.sample(accurate.vertices_mm, accurate.triangles))
    normals = vertex_normals(accurate.vertices_mm, accurate.triangles)
    there = np.nan_to_num(found.sample(normals, accurate.triangles))[triangles].sum(axis=1)
    return whole & ((triangle_normals(points, triangles) * there).sum(axis=1) <= 0)
