"""What a result is compared with: truth, or a held-out reconstruction, in correspondence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.lips import triangle_sides
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, triangle_normals, vertex_normals
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.storage.errors import InputError

_CROP_MARGIN_MM = 25.0


@dataclass(frozen=True)
class Reference:
    """The surface that a take should have had.

    Attributes:
        kind: `truth` or `H`.
        points_mm: (F, V, 3) where each vertex of the compared topology belongs; NaN where unknown.
        vertices_mm: (F, S, 3) the surface itself.
        triangles: (U, 3) of the surface.
        neutral_mm: (V, 3) the points in the neutral, any head pose; None: the first frame is it.
        neutral_surface_mm: (S, 3) the surface in the neutral, the pose of `neutral_mm`; None likewise.
    """

    kind: str
    points_mm: np.ndarray
    vertices_mm: np.ndarray
    triangles: np.ndarray
    neutral_mm: np.ndarray | None = None
    neutral_surface_mm: np.ndarray | None = None

    @property
    def rest_mm(self) -> np.ndarray:
        """(V, 3) the points in the neutral."""
        return self.points_mm[0] if self.neutral_mm is None else self.neutral_mm

    @property
    def rest_surface_mm(self) -> np.ndarray:
        """(S, 3) the surface in the neutral."""
        neutral = self.neutral_surface_mm
        return np.asarray(self.vertices_mm[0] if neutral is None else neutral, dtype=np.float64)

    @property
    def valid(self) -> np.ndarray:
        """(V,) bool: vertices with a counterpart."""
        return np.isfinite(self.points_mm).all(axis=(0, 2))


def reference_of(
    kind: str,
    where: SurfacePoints,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    neutral_mm: np.ndarray | None = None,
    **place,
) -> Reference:
    """Follow points on a surface through its frames.

    The surface is cropped to the surroundings of the points in the first frame: the back of a head
    is no neighbour of a face.

    Args:
        kind: `truth` or `H`.
        where: V points on the surface.
        vertices_mm: (F, S, 3) the surface, any world, mm.
        triangles: (U, 3) of it.
        neutral_mm: (S, 3) the surface at the neutral; None: the first frame is it.
        place: subject and take, for messages.

    Returns:
        the reference, in the surface's world.

    Raises:
        InputError: no vertex has a point on the surface.
    """
    if not where.bound.any():
        raise InputError(
            "no vertex with a point on the surface that it is measured against",
            "truth in the world of the rig, in millimetres, whose first frame is the neutral",
            "Look at evaluation.truth, and at evaluation.reference for what counts as near.",
            **place,
        )
    points = where.sample(vertices_mm, triangles)
    first = points[0][np.isfinite(points[0]).all(axis=1)]
    low, high = first.min(axis=0) - _CROP_MARGIN_MM, first.max(axis=0) + _CROP_MARGIN_MM
    near = ((vertices_mm[0] >= low) & (vertices_mm[0] <= high)).all(axis=1)
    at_rest = None if neutral_mm is None else where.sample(neutral_mm, triangles)
    kept = triangles[near[triangles].all(axis=1)]
    return Reference(kind, points, vertices_mm, kept, at_rest, neutral_mm)


@dataclass(frozen=True)
class MatchTolerance:
    """What counts as the same place on two surfaces.

    Attributes:
        max_distance_mm: points farther away have no counterpart.
        max_normal_angle_deg: between the normals of a point and of its triangle.
    """

    max_distance_mm: float
    max_normal_angle_deg: float

    @property
    def min_cosine(self) -> float:
        """Of the angle between the normals."""
        return float(np.cos(np.radians(self.max_normal_angle_deg)))


def attach(
    points_mm: np.ndarray,
    normals: np.ndarray,
    sides: np.ndarray,
    h_neutral: Mesh,
    h_sides: np.ndarray,
    truth_neutral: Mesh,
    near: MatchTolerance,
) -> SurfacePoints:
    """The truth's point that each given point lies on, in the neutral, once a subject.

    Closest point among the triangles that face the same way and do not belong to the other lip.

    Args:
        points_mm, normals: (N, 3) in the truth's world, mm; unit.
        sides: (N,) lips, +1 upper, -1 lower, 0 neither.
        h_neutral: Vh vertices of H, mm, by which the truth's lips are known.
        h_sides: (Vh,) lips of H's vertices.
        truth_neutral: the truth's mesh, mm.
        near: points that are not near are unbound.

    Returns:
        N points of the truth.
    """
    truth_sides = transfer_lips(h_neutral, h_sides, truth_neutral, near)
    surface = Surface(truth_neutral.vertices_mm, truth_neutral.triangles)
    found = surface.closest(points_mm, normals, near.min_cosine, sides, truth_sides)
    return found.within(near.max_distance_mm)


def transfer_lips(mesh: Mesh, sides: np.ndarray, other: Mesh, near: MatchTolerance) -> np.ndarray:
    """Lips of the triangles of another mesh of the same face in the same pose.

    Args:
        mesh: V vertices, whose lips are known, mm.
        sides: (V,) +1 upper, -1 lower, 0 neither.
        other: T' triangles, in the same world, mm.
        near: triangles that are not near have no side.

    Returns:
        (T',) int8 likewise.
    """
    # By the triangles' middles: where lips touch, vertices lie on both.
    middles = other.vertices_mm[other.triangles].mean(axis=1)
    normals = triangle_normals(other.vertices_mm, other.triangles)
    found = Surface(mesh.vertices_mm, mesh.triangles).closest(middles, normals, near.min_cosine)
    close = found.within(near.max_distance_mm)
    of_triangle = triangle_sides(mesh.triangles, sides)
    return np.where(close.bound, of_triangle[np.maximum(found.triangle, 0)], 0)


def truth_of_vertices(
    where_on_h: SurfacePoints,
    h_neutral: Mesh,
    h_sides: np.ndarray,
    sides: np.ndarray,
    truth_neutral: Mesh,
    near: MatchTolerance,
) -> SurfacePoints:
    """The truth's point of each vertex of C: C vertex -> H -> closest point of the truth's neutral.

    Both neutrals are the same frame of the same take in the same world. No triangle of one lip is
    taken for a vertex of the other.

    Args:
        where_on_h: V points, C's vertices on H.
        h_neutral: Vh vertices of H, mm.
        h_sides: (Vh,) lips of H's vertices, +1 upper, -1 lower, 0 neither.
        sides: (V,) lips of C's vertices.
        truth_neutral: the truth's mesh, mm.
        near: what counts as the same place.

    Returns:
        V points of the truth; unbound where H or the truth has none.
    """
    on_h = vertex_normals(h_neutral.vertices_mm, h_neutral.triangles)
    points, normals = (
        np.nan_to_num(where_on_h.sample(values, h_neutral.triangles))
        for values in (h_neutral.vertices_mm, on_h)
    )
    found = attach(points, normals, sides, h_neutral, h_sides, truth_neutral, near)
    return found.restricted(where_on_h.bound)


def drift(
    sequence_mm: np.ndarray,
    triangles: np.ndarray,
    reference: Reference,
    vertices: np.ndarray,
    min_cosine: float,
) -> np.ndarray:
    """How far each vertex has slid along the true surface since the neutral, (F, V) mm.

    Distance between the point of the truth that the vertex lies on (nearest, facing the same way)
    and the point that it lay on in the neutral. NaN for vertices that are not asked for.

    Args:
        sequence_mm: (F, V, 3) in the reference's world.
        triangles: (T, 3) of it.
        vertices: (V,) bool.
    """
    ids = np.flatnonzero(vertices)
    result = np.full(sequence_mm.shape[:2], np.nan)
    for frame, (points, surface_mm) in enumerate(
        zip(sequence_mm, reference.vertices_mm, strict=True)
    ):
        surface = Surface(surface_mm, reference.triangles)
        normals = vertex_normals(points.astype(np.float64), triangles)[ids]
        found = surface.closest(points[ids], normals, min_cosine)
        nearest = found.sample(surface_mm, reference.triangles)
        result[frame, ids] = np.linalg.norm(nearest - reference.points_mm[frame, ids], axis=1)
    return result
