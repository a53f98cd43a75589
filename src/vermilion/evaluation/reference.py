"""What a result is compared with: truth, or a held-out reconstruction, in correspondence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.geometry.closest_points import Surface, SurfacePoints
from vermilion.geometry.mesh import triangle_normals, vertex_normals
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
    """

    kind: str
    points_mm: np.ndarray
    vertices_mm: np.ndarray
    triangles: np.ndarray
    neutral_mm: np.ndarray | None = None

    @property
    def rest_mm(self) -> np.ndarray:
        """(V, 3) the points in the neutral."""
        return self.points_mm[0] if self.neutral_mm is None else self.neutral_mm

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
    """Follow `where` (V points on the surface) through the surface's frames (F, S, 3).

    The surface is cropped to the surroundings of the points in the first frame: the back of a head
    is no neighbour of a face.

    Args:
        neutral_mm: (S, 3) the surface at the neutral; None: the first frame is it.
        place: subject and take, for messages.

    Raises:
        InputError: no vertex has a point on the surface.
    """
    if not where.found.any():
        raise InputError(
            "no vertex with a point on the surface that it is measured against",
            "truth in the world of the rig, in millimetres, whose first frame is the neutral",
            "Look at evaluation.truth, and at evaluation.reference for what counts as near.",
            **place,
        )
    points = where.on(np.asarray(vertices_mm, dtype=np.float64), triangles)
    first = points[0][np.isfinite(points[0]).all(axis=1)]
    low, high = first.min(axis=0) - _CROP_MARGIN_MM, first.max(axis=0) + _CROP_MARGIN_MM
    near = ((vertices_mm[0] >= low) & (vertices_mm[0] <= high)).all(axis=1)
    if neutral_mm is not None:
        neutral_mm = where.on(np.asarray(neutral_mm, dtype=np.float64), triangles)
    kept = triangles[near[triangles].all(axis=1)]
    return Reference(kind, points, vertices_mm, kept, neutral_mm)


def attach(
    points_mm: np.ndarray,
    normals: np.ndarray,
    lips: np.ndarray,
    surface: Surface,
    triangle_lips: np.ndarray,
    max_distance_mm: float,
    min_cosine: float,
) -> SurfacePoints:
    """The point of a surface that each given point lies on, in the neutral, once a subject.

    Nearest point among the triangles that face the same way and do not belong to the other lip.
    Points farther away than `max_distance_mm` have none.

    Args:
        points_mm, normals: (N, 3) in the surface's world.
        lips: (N,) 1 upper, 2 lower, 0 neither.
        triangle_lips: (T,) the same of the surface's triangles.
    """
    found = surface.closest(points_mm, normals, min_cosine, lips, triangle_lips)
    far = found.distance_mm > max_distance_mm
    return SurfacePoints(
        np.where(far, -1, found.triangle),
        found.barycentric,
        np.where(far, np.inf, found.distance_mm),
    )


def transfer_lips(
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    lips: np.ndarray,
    to_vertices_mm: np.ndarray,
    to_triangles: np.ndarray,
    max_distance_mm: float,
    min_cosine: float,
) -> np.ndarray:
    """Lip labels (T',) of the triangles of another mesh of the same face in the same pose.

    Args:
        vertices_mm, triangles, lips: the labelled mesh, labels (V,).
        to_vertices_mm, to_triangles: the mesh without labels.
    """
    # By the triangles' middles: where lips touch, vertices lie on both.
    middles = to_vertices_mm[to_triangles].mean(axis=1)
    normals = triangle_normals(to_vertices_mm, to_triangles)
    found = Surface(vertices_mm, triangles).closest(middles, normals, min_cosine)
    near = found.found & (found.distance_mm <= max_distance_mm)
    corners = lips[triangles]
    both = (corners == 1).any(axis=1) & (corners == 2).any(axis=1)
    of_triangle = np.where(both, 0, corners.max(axis=1))
    return np.where(near, of_triangle[np.maximum(found.triangle, 0)], 0)


def truth_of_vertices(
    where_on_h: SurfacePoints,
    h_neutral_mm: np.ndarray,
    h_triangles: np.ndarray,
    h_lips: np.ndarray,
    lips: np.ndarray,
    truth_neutral_mm: np.ndarray,
    truth_triangles: np.ndarray,
    max_distance_mm: float,
    min_cosine: float,
) -> SurfacePoints:
    """The truth's point of each vertex of C: C vertex -> H -> nearest point of the truth's neutral.

    Both neutrals are the same frame of the same take in the same world. No triangle of one lip is
    taken for a vertex of the other.

    Args:
        where_on_h: (V,) points of C's vertices on H.
        h_lips: (Vh,) lip labels of H's vertices; lips: (V,) of C's.
    """
    labels = transfer_lips(
        h_neutral_mm, h_triangles, h_lips, truth_neutral_mm, truth_triangles,
        max_distance_mm, min_cosine,
    )  # fmt: skip
    points = where_on_h.on(h_neutral_mm, h_triangles)
    normals = where_on_h.on(vertex_normals(h_neutral_mm, h_triangles), h_triangles)
    known = where_on_h.found
    found = attach(
        np.nan_to_num(points), np.nan_to_num(normals), lips,
        Surface(truth_neutral_mm, truth_triangles), labels, max_distance_mm, min_cosine,
    )  # fmt: skip
    return SurfacePoints(
        np.where(known, found.triangle, -1),
        found.barycentric,
        np.where(known, found.distance_mm, np.inf),
    )


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
        sequence_mm: (F, V, 3) in the reference's world; triangles: (T, 3) of it.
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
        nearest = found.on(np.asarray(surface_mm, dtype=np.float64), reference.triangles)
        result[frame, ids] = np.linalg.norm(nearest - reference.points_mm[frame, ids], axis=1)
    return result
