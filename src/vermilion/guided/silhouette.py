"""Silhouettes of the lips in a camera, as segments on the surface (Guided18 section 5).

The silhouette is where the interpolated normal is at a right angle to the view: in each triangle
whose corners face both ways, a segment between points on two of its edges. So the nearest silhouette
point to a ray moves continuously, and no vertex has to lie on the silhouette.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.contours import LEFT_CORNER, RIGHT_CORNER
from vermilion.faces.lips import lips_with_inside
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import boundary_edges, normalised, triangle_cross
from vermilion.geometry.mesh_points import MeshPoints
from vermilion.guided.regions import GuidedRegions

UPPER, LOWER = 1, 2


@dataclass(frozen=True)
class LipSurface:
    """The triangles on which contours are looked for.

    Attributes:
        triangles: (n, 3) that may carry the inner silhouette.
        around: (k, 3) triangles that touch their vertices, for the normals.
        rim: (b, 2) edges of `triangles` where the mesh itself ends.
        sides: (V,) int8: 1 upper lip, 2 lower; 0 unknown: only the projected normal tells.
        outer_upper, outer_lower: (e, 2) edges of the border of the red; empty where unknown.
    """

    triangles: np.ndarray
    around: np.ndarray
    rim: np.ndarray
    sides: np.ndarray
    outer_upper: np.ndarray
    outer_lower: np.ndarray

    @classmethod
    def of_regions(cls, regions: GuidedRegions) -> LipSurface:
        """The predicted triangles of any topology: no sides, no outer contour."""
        nobody = np.zeros(regions.n_vertices, dtype=np.int8)
        none = np.zeros((0, 2), dtype=np.int64)
        chosen = regions.triangles[regions.predicted]
        return cls(*_around(regions.triangles, chosen, regions.n_vertices), nobody, none, none)

    @classmethod
    def of_face(cls, face: FaceModel, regions: GuidedRegions) -> LipSurface:
        """The lips of a face model and the predicted triangles, with sides and outer contour."""
        sides = lips_with_inside(face)
        of_lips = (sides > 0)[face.triangles].all(axis=1)
        of_lips[regions.predicted] = True
        upper, lower = outer_halves(face)
        chosen = face.triangles[of_lips]
        return cls(*_around(face.triangles, chosen, face.n_vertices), sides, upper, lower)


@dataclass(frozen=True)
class Segments:
    """Segments on a mesh, seen by a camera.

    Attributes:
        start, end: S points each, of two vertices.
        start_px, end_px: (S, 2).
        start_depth, end_depth: (S,) mm along the view.
        normal: (S, 3) of the surface.
    """

    start: MeshPoints
    end: MeshPoints
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

    def nearest(self, pixels: np.ndarray) -> tuple[MeshPoints, np.ndarray]:
        """The nearest point to the ray of each pixel (P, 2), and its distance (P,) px.

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
        share = near / (near + far)
        start, end = self.start[best], self.end[best]
        vertices = np.concatenate([start.vertices, end.vertices], axis=1)
        weights = np.concatenate(
            [start.weights * (1 - share)[:, None], end.weights * share[:, None]], axis=1
        )
        return MeshPoints(vertices, weights), np.sqrt(apart.min(axis=1))


def inner_silhouettes(
    vertices_mm: np.ndarray, surface: LipSurface, camera: Camera, up: np.ndarray
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
    sides = surface.sides[segments.start.vertices[:, 0]]
    upper = (projected < 0) & (sides != LOWER)
    lower = (projected > 0) & (sides != UPPER)
    return segments[upper], segments[lower]


def outer_contours(
    vertices_mm: np.ndarray, surface: LipSurface, camera: Camera
) -> tuple[Segments, Segments]:
    """(upper, lower) border of the red, which is a line of the mesh."""
    return tuple(
        _edge_segments(vertices_mm, edges, np.zeros((len(vertices_mm), 3)), camera)
        for edges in (surface.outer_upper, surface.outer_lower)
    )


def outer_halves(face: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n, 2) of the outer contour's upper and lower half, split at the mouth corners."""
    loop = np.asarray(face.outer_contour, dtype=np.int64)
    points = face.neutral_mm[loop]
    corners = face.neutral_mm[face.landmarks[[RIGHT_CORNER, LEFT_CORNER]]]
    right, left = (int(np.linalg.norm(points - c, axis=1).argmin()) for c in corners)
    loop, points = np.roll(loop, -right), np.roll(points, -right, axis=0)
    turn = (left - right) % len(loop)
    edges = np.stack([loop, np.roll(loop, -1)], axis=1)
    first, second = edges[:turn], edges[turn:]
    if points[1:turn, 1].mean() < points[turn + 1 :, 1].mean():
        return second, first
    return first, second


def _around(triangles: np.ndarray, chosen: np.ndarray, n_vertices: int) -> tuple[np.ndarray, ...]:
    touched = np.zeros(n_vertices, dtype=bool)
    touched[chosen] = True
    around = triangles[touched[triangles].any(axis=1)]
    ends = boundary_edges(triangles)
    return chosen, around, ends[touched[ends].all(axis=1)]


def _normals(vertices_mm: np.ndarray, surface: LipSurface) -> np.ndarray:
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
    vertices_mm: np.ndarray, normals: np.ndarray, surface: LipSurface, camera: Camera
) -> Segments:
    """Segments where normal . view = 0 inside triangles, and the mesh's own ends that face us."""
    corners = surface.triangles
    ids = np.unique(corners)
    facing = np.zeros(len(vertices_mm))
    facing[ids] = ((camera.centre_mm - vertices_mm[ids]) * normals[ids]).sum(axis=1)
    front = facing[corners] > 0
    mixed = front.any(axis=1) & ~front.all(axis=1)
    corners, front = corners[mixed], front[mixed]
    # The corner that faces another way than the other two: both edges from it are crossed.
    alone = np.where(front.sum(axis=1) == 1, front.argmax(axis=1), (~front).argmax(axis=1))
    rows = np.arange(len(corners))
    lone, second, third = (corners[rows, (alone + k) % 3] for k in range(3))
    ends = []
    for other in (second, third):
        fraction = facing[lone] / (facing[lone] - facing[other])
        ends.append(MeshPoints.on_edges(lone, other, fraction))
    middle = 0.5 * (ends[0].of(normals) + ends[1].of(normals))
    found = _seen(vertices_mm, *ends, middle, camera)
    rim = surface.rim[(facing[surface.rim] > 0).all(axis=1)]
    if len(rim) == 0:
        return found
    return _joined(found, _edge_segments(vertices_mm, rim, normals, camera))


def _edge_segments(
    vertices_mm: np.ndarray, edges: np.ndarray, normals: np.ndarray, camera: Camera
) -> Segments:
    first, second = edges[:, 0], edges[:, 1]
    nothing = np.zeros(len(edges))
    start = MeshPoints.on_edges(first, second, nothing)
    end = MeshPoints.on_edges(second, first, nothing)
    return _seen(vertices_mm, start, end, normals[first] + normals[second], camera)


def _seen(
    vertices_mm: np.ndarray, start: MeshPoints, end: MeshPoints, normal: np.ndarray, camera: Camera
) -> Segments:
    first, second = start.of(vertices_mm), end.of(vertices_mm)
    depth = [camera.to_camera(points)[:, 2] for points in (first, second)]
    segments = Segments(
        start, end, camera.project(first), camera.project(second), depth[0], depth[1], normal
    )
    visible = np.isfinite(segments.start_px).all(axis=1) & np.isfinite(segments.end_px).all(axis=1)
    return segments[visible]


def _joined(a: Segments, b: Segments) -> Segments:
    points = [
        MeshPoints(
            np.concatenate([getattr(a, k).vertices, getattr(b, k).vertices]),
            np.concatenate([getattr(a, k).weights, getattr(b, k).weights]),
        )
        for k in ("start", "end")
    ]
    names = ("start_px", "end_px", "start_depth", "end_depth", "normal")
    return Segments(*points, *(np.concatenate([getattr(a, n), getattr(b, n)]) for n in names))
