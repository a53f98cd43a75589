"""Silhouettes of the lips in a camera, as segments on the surface (Guided18 section 5).

The silhouette is where the interpolated normal is at a right angle to the view: in each triangle
whose corners face both ways, a segment between points on two of its edges. So the nearest silhouette
point to a ray moves continuously, and no vertex has to lie on the silhouette.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.contours import contour_halves
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import boundary_edges, normalised, triangle_cross
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.guided.regions import GuidedRegions

UPPER, LOWER = 1, -1


@dataclass(frozen=True)
class SurfaceEdges:
    """Edges of a mesh as segments on its surface.

    Attributes:
        vertices: (e, 2) ids.
        start: e points, at one end.
        end: e points, at the other end, bound to the same triangles.
    """

    vertices: np.ndarray
    start: SurfacePoints
    end: SurfacePoints

    @classmethod
    def of(cls, edges: np.ndarray, triangles: np.ndarray) -> SurfaceEdges:
        """edges: (e, 2) ids, of a mesh of triangles (T, 3)."""
        ends = (
            SurfacePoints.on_edges(edges[:, 0], edges[:, 1], np.full(len(edges), share), triangles)
            for share in (0.0, 1.0)
        )
        return cls(edges, *ends)


@dataclass(frozen=True)
class ContourSurface:
    """The part of a mesh on which contours are looked for.

    Attributes:
        triangles: (T, 3) of the mesh.
        candidates: (n,) ids of the triangles that may carry the inner silhouette.
        around: (k, 3) triangles that touch their vertices, for the normals.
        sides: (V,) int8: +1 upper lip, -1 lower; 0 unknown: only the projected normal tells.
        rim: edges of the candidates where the mesh itself ends.
        outer_upper: edges of the upper border of the red; none where unknown.
        outer_lower: edges of the lower border; none where unknown.
    """

    triangles: np.ndarray
    candidates: np.ndarray
    around: np.ndarray
    sides: np.ndarray
    rim: SurfaceEdges
    outer_upper: SurfaceEdges
    outer_lower: SurfaceEdges

    @classmethod
    def of_regions(cls, regions: GuidedRegions) -> ContourSurface:
        """The predicted triangles of any topology: no sides, no outer contour."""
        nobody = np.zeros(regions.n_vertices, dtype=np.int8)
        none = np.zeros((0, 2), dtype=np.int64)
        return cls._of(regions.triangles, regions.predicted, nobody, (none, none))

    @classmethod
    def of_face(cls, face: FaceModel, regions: GuidedRegions) -> ContourSurface:
        """The lips of a face model and the predicted triangles, with sides and outer contour."""
        sides = lip_sides(face, with_inside=True)
        of_lips = (sides != 0)[face.triangles].all(axis=1)
        of_lips[regions.predicted] = True
        return cls._of(face.triangles, np.flatnonzero(of_lips), sides, outer_halves(face))

    @classmethod
    def _of(
        cls,
        triangles: np.ndarray,
        candidates: np.ndarray,
        sides: np.ndarray,
        outer: tuple[np.ndarray, np.ndarray],
    ) -> ContourSurface:
        touched = np.zeros(len(sides), dtype=bool)
        touched[triangles[candidates]] = True
        around = triangles[touched[triangles].any(axis=1)]
        ends = boundary_edges(triangles)
        upper, lower = (SurfaceEdges.of(edges, triangles) for edges in outer)
        rim = SurfaceEdges.of(ends[touched[ends].all(axis=1)], triangles)
        return cls(triangles, candidates, around, sides, rim, upper, lower)


@dataclass(frozen=True)
class Segments:
    """Segments on a mesh, seen by a camera.

    Attributes:
        start: S points, at one end.
        end: S points, at the other end, bound to the same triangles.
        start_px: (S, 2).
        end_px: (S, 2).
        start_depth: (S,) mm along the view.
        end_depth: (S,) mm along the view.
        normal: (S, 3) of the surface, not of unit length.
    """

    start: SurfacePoints
    end: SurfacePoints
    start_px: np.ndarray
    end_px: np.ndarray
    start_depth: np.ndarray
    end_depth: np.ndarray
    normal: np.ndarray

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, chosen: np.ndarray) -> Segments:
        return Segments(
            self.start[chosen], self.end[chosen], self.start_px[chosen], self.end_px[chosen],
            self.start_depth[chosen], self.end_depth[chosen], self.normal[chosen],
        )  # fmt: skip

    def shared_vertex(self, triangles: np.ndarray) -> np.ndarray:
        """The corner from which both ends are reached along edges of triangles (T, 3), (S,) ids.

        The start of a segment that is itself an edge.
        """
        corners, rows = self.start.corners(triangles), np.arange(len(self))
        both = np.minimum(self.start.barycentric, self.end.barycentric)
        return corners[rows, (both + 1e-9 * self.start.barycentric).argmax(axis=1)]

    def nearest(self, pixels: np.ndarray) -> tuple[SurfacePoints, np.ndarray]:
        """The nearest point to the ray of pixels (P, 2), P of them, and its distance (P,) px.

        Raises ValueError where there is no segment.
        """
        if len(self) == 0:
            raise ValueError("no segment to be near to")
        along = self.end_px - self.start_px
        squared = np.maximum((along**2).sum(axis=1), 1e-12)
        off = pixels[:, None] - self.start_px
        fraction = np.clip((off * along).sum(axis=2) / squared, 0.0, 1.0)
        apart = ((off - fraction[..., None] * along) ** 2).sum(axis=2)
        best = apart.argmin(axis=1)
        image = fraction[np.arange(len(pixels)), best]
        # Halfway in the image is not halfway on the surface: the nearer end counts more.
        near, far = image / self.end_depth[best], (1 - image) / self.start_depth[best]
        share = (near / (near + far))[:, None]
        start, end = self.start[best], self.end[best]
        between = (1 - share) * start.barycentric + share * end.barycentric
        return SurfacePoints(start.triangle, between), np.sqrt(apart.min(axis=1))


def inner_silhouettes(
    vertices_mm: np.ndarray, surface: ContourSurface, camera: Camera, up: np.ndarray
) -> tuple[Segments, Segments]:
    """(upper, lower) silhouettes of the lips, told by the projected normal.

    The normal of the lower lip's silhouette points up in the image, that of the upper lip's down;
    where sides are known, they must agree.

    Args:
        vertices_mm: (V, 3), the camera's world.
        up: (2,) across the mouth in the image, towards the nose.
    """
    normals = normalised(_normals(vertices_mm, surface))
    segments = _zero_segments(vertices_mm, normals, surface, camera)
    projected = segments.normal @ camera.rotation[:2].T @ up
    sides = surface.sides[segments.shared_vertex(surface.triangles)]
    upper = (projected < 0) & (sides != LOWER)
    lower = (projected > 0) & (sides != UPPER)
    return segments[upper], segments[lower]


def outer_contours(
    vertices_mm: np.ndarray, surface: ContourSurface, camera: Camera
) -> tuple[Segments, Segments]:
    """(upper, lower) border of the red, which is a line of the mesh.

    Args:
        vertices_mm: (V, 3), the camera's world.
    """
    flat = np.zeros((len(vertices_mm), 3))
    upper, lower = (
        _edge_segments(vertices_mm, flat, edges, surface.triangles, camera)
        for edges in (surface.outer_upper, surface.outer_lower)
    )
    return upper, lower


def outer_halves(face: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n, 2) of the outer contour's upper and lower half, split at the mouth corners."""
    upper, _ = contour_halves(face.neutral_mm, face.landmarks, face.outer_contour)
    loop = np.asarray(face.outer_contour, dtype=np.int64)
    loop = np.roll(loop, -np.flatnonzero(loop == upper[0])[0])
    edges = np.stack([loop, np.roll(loop, -1)], axis=1)
    on_upper = np.isin(edges, upper).all(axis=1)
    return edges[on_upper], edges[~on_upper]


def _normals(vertices_mm: np.ndarray, surface: ContourSurface) -> np.ndarray:
    """Area-weighted normals (V, 3); zero away from the surface."""
    cross = triangle_cross(vertices_mm, surface.around)
    result = np.zeros((len(vertices_mm), 3))
    for k in range(3):
        column = np.bincount(
            surface.around.ravel(), np.repeat(cross[:, k], 3), minlength=len(result)
        )
        result[:, k] = column
    return result


def _zero_segments(
    vertices_mm: np.ndarray, normals: np.ndarray, surface: ContourSurface, camera: Camera
) -> Segments:
    """Segments where normal . view = 0 inside triangles, and the mesh's own ends that face us."""
    corners = surface.triangles[surface.candidates]
    ids = np.unique(corners)
    facing = np.zeros(len(vertices_mm))
    facing[ids] = ((camera.centre_mm - vertices_mm[ids]) * normals[ids]).sum(axis=1)
    front = facing[corners] > 0
    mixed = front.any(axis=1) & ~front.all(axis=1)
    values, front = facing[corners[mixed]], front[mixed]
    # The corner that faces another way than the other two: both edges from it are crossed.
    alone = np.where(front.sum(axis=1) == 1, front.argmax(axis=1), (~front).argmax(axis=1))
    rows = np.arange(len(values))
    ends = []
    for other in ((alone + 1) % 3, (alone + 2) % 3):
        fraction = values[rows, alone] / (values[rows, alone] - values[rows, other])
        barycentric = np.zeros((len(values), 3))
        barycentric[rows, alone], barycentric[rows, other] = 1.0 - fraction, fraction
        ends.append(SurfacePoints(surface.candidates[mixed], barycentric))
    start, end = ends
    normal = start.sample(normals, surface.triangles) + end.sample(normals, surface.triangles)
    found = _seen(vertices_mm, start, end, normal, surface.triangles, camera)
    chosen = (facing[surface.rim.vertices] > 0).all(axis=1)
    if not chosen.any():
        return found
    rim = SurfaceEdges(
        surface.rim.vertices[chosen], surface.rim.start[chosen], surface.rim.end[chosen]
    )
    return _joined(found, _edge_segments(vertices_mm, normals, rim, surface.triangles, camera))


def _edge_segments(
    vertices_mm: np.ndarray,
    normals: np.ndarray,
    edges: SurfaceEdges,
    triangles: np.ndarray,
    camera: Camera,
) -> Segments:
    normal = normals[edges.vertices].sum(axis=1)
    return _seen(vertices_mm, edges.start, edges.end, normal, triangles, camera)


def _seen(
    vertices_mm: np.ndarray,
    start: SurfacePoints,
    end: SurfacePoints,
    normal: np.ndarray,
    triangles: np.ndarray,
    camera: Camera,
) -> Segments:
    first, second = (points.sample(vertices_mm, triangles) for points in (start, end))
    depth = [camera.to_camera(points)[:, 2] for points in (first, second)]
    segments = Segments(
        start, end, camera.project(first), camera.project(second), depth[0], depth[1], normal
    )
    visible = np.isfinite(segments.start_px).all(axis=1) & np.isfinite(segments.end_px).all(axis=1)
    return segments[visible]


def _joined(a: Segments, b: Segments) -> Segments:
    start, end = (
        SurfacePoints(
            np.concatenate([first.triangle, second.triangle]),
            np.concatenate([first.barycentric, second.barycentric]),
        )
        for first, second in ((a.start, b.start), (a.end, b.end))
    )
    names = ("start_px", "end_px", "start_depth", "end_depth", "normal")
    return Segments(start, end, *(np.concatenate([getattr(a, n), getattr(b, n)]) for n in names))
