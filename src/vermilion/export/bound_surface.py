"""A surface of any topology that follows another mesh by its deformation (Sumner and Popovic 2004).

With S_t the gradient that takes the triangle of the driving mesh nearest to triangle t from rest to a
pose, y the surface at rest and p_i where vertex i is carried by its nearest triangle, the pose x
minimises

    sum_t sum_(ij in t) w_ij |(x_i - x_j) - S_t (y_i - y_j)|^2  +  sum_i a_i |x_i - p_i|^2 / R^2
        + C sum_k |(x_u(k) - x_l(k))_up - g_k|^2

with cotangent weights w and areas a (none inside the mouth, where nothing is known), and pairs of points
of the upper and lower lip whose distance g along the head's up axis is that of the driving mesh: lips
meet where its lips meet. Away from the driving mesh, what it does fades out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.faces.contours import contour_halves
from vermilion.faces.lips import lip_sides_by_distance, triangle_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.cotangents import cotangents
from vermilion.geometry.gradient_sums import GradientSums, turned_by
from vermilion.geometry.mesh import Mesh, triangle_normals, vertex_areas, vertex_normals
from vermilion.geometry.polylines import lengths_along
from vermilion.geometry.sparse import CholeskyFactor
from vermilion.geometry.surface_points import SurfacePoints

# Constants, not keys: they belong to this method, lengths are those of a head in mm whatever its file's unit, and none
# decides much. Found on `python -m benchmarks own_head`, where the lips' motion is 0.0198 mm off for the person's
# head and 0.119 for another person's; what half and double of each change is said beside it.
#: R: detail of a shorter wavelength than 2 pi R follows gradients, longer follows places. Half or double: the lips
#: 0.0198 or 0.0202, another person's 0.123 or 0.115.
_SCREEN_MM = 3.0
#: Stiffness of the inside of the mouth, which the driving mesh hardly has, against the skin's: 1 pulls the lips
#: along (0.073 mm), a quarter or four times 0.021 at most.
_INSIDE = 0.02
#: Beyond the driving mesh, what it does fades out over this distance. Half or double: nothing at the lips; the inside of
#: the mouth, which has no truth on a real head, 1.11 or 0.93 for 0.98 mm.
_FADE_MM = 15.0
#: Normals of a point and what it is bound to: the cosine at least. Any (-1): the lips 0.0203; 0 or 0.5: as here.
_COSINE = 0.2
#: Something nearer by more than this is bound to, whichever way it faces. Half or double: nothing on these heads.
_FARTHER_MM = 4.0
#: Near the corners of the mouth, where this much lies between them, the lips are one surface. Half or double: nothing.
_CORNER_MM = 4.0
#: Pairs of points along the lips, more than a head has vertices there (half or double: nothing), and the weight of
#: their distance against the mean stiffness: gaps are 0.001 mm off at 100, none at 10,000.
_PAIRS, _CONTACT = 64, 1e4
#: Keeps parts that nothing holds solvable, against the mean stiffness; a hundredth or a hundredfold: nothing at the lips.
_LEAST_HELD = 1e-8
_UP, _ACROSS = 1, [0, 2]


@dataclass(frozen=True)
class Bound:
    """What of the driving mesh each point of the surface follows.

    Attributes:
        points: (N,) on the driving mesh.
        share: (N,) how much of it, 1 on it and 0 far away.
    """

    points: SurfacePoints
    share: np.ndarray


class BoundSurface:
    """Poses a surface of Y vertices as a driving mesh of V vertices is posed; factors once."""

    def __init__(self, labels: FaceModel, driver: FaceModel):
        """Bind.

        Args:
            labels: the surface at rest (its neutral, Y vertices) with its regions, contours, landmarks.
            driver: the mesh laid over it (its neutral, V vertices), labelled likewise; the same frame, mm.
        """
        self.rest_mm, self.triangles = labels.neutral_mm, labels.triangles.astype(np.int64)
        own, theirs = (_lip_sides(model) for model in (labels, driver))
        surface = Surface(driver.neutral_mm, driver.triangles)
        sides = triangle_sides(driver.triangles, theirs)
        normals = vertex_normals(self.rest_mm, self.triangles)
        vertices = _bind(surface, self.rest_mm, normals, own, sides)
        centres, facing = (
            self.rest_mm[self.triangles].mean(axis=1),
            triangle_normals(self.rest_mm, self.triangles),
        )
        of_triangles = triangle_sides(self.triangles, own)
        faces = _bind(surface, centres, facing, of_triangles, sides)
        self._driver_pairs, self._pairs = _lip_pairs(driver, labels, own)
        self._prepare(labels, driver, vertices, faces)

    def _prepare(self, labels: FaceModel, driver: FaceModel, at: Bound, faces: Bound) -> None:
        triangles, n_vertices = self.triangles, len(self.rest_mm)
        ends = np.stack([triangles[:, [1, 2, 0]].ravel(), triangles[:, [2, 0, 1]].ravel()])
        rows, ones = np.arange(ends.shape[1]), np.ones(ends.shape[1])
        shape = (len(rows), n_vertices)
        edge = sparse.csr_matrix((ones, (rows, ends[0])), shape=shape)
        edge -= sparse.csr_matrix((ones, (rows, ends[1])), shape=shape)
        inside = labels.regions["mouth_inner"]
        stiff = np.where(inside[triangles].any(axis=1), _INSIDE, 1.0)[:, None]
        weights = sparse.diags_array((stiff * cotangents(self.rest_mm, triangles)).ravel())
        gather = sparse.csr_matrix((weights @ edge).T)
        stiffness = sparse.csc_matrix(gather @ edge)
        mean = float(stiffness.diagonal().mean())
        areas = vertex_areas(self.rest_mm, triangles)
        hold = np.maximum(np.where(inside, 0.0, areas / _SCREEN_MM**2), _LEAST_HELD * mean)
        matrix = sparse.csc_matrix(stiffness + sparse.diags_array(hold))
        self._meet = sparse.csr_matrix(_CONTACT * mean * self._pairs.T)
        self._across = CholeskyFactor(matrix)
        self._along = CholeskyFactor(sparse.csc_matrix(matrix + self._meet @ self._pairs))
        self._right, self._still = self._right_side(driver, (gather, edge), hold, at, faces)

    def _right_side(
        self, driver: FaceModel, edges: tuple[sparse.csr_matrix, sparse.csr_matrix],
        hold: np.ndarray, at: Bound, faces: Bound,
    ) -> tuple[GradientSums, np.ndarray]:  # fmt: skip
        """The right side as it follows from a pose of the driving mesh, and its constant part (Y, 3).

        `edges` are the weighted sums over edges (Y, E), and the edges (E, Y). With a share less than 1 the rest of a
        gradient is the identity, and the rest of a place that at rest.
        """
        gather, edge = edges
        count, rest = len(driver.triangles), driver.neutral_mm
        triangle, share = (np.repeat(values, 3) for values in (faces.points.triangle, faces.share))
        edges_mm = edge @ self.rest_mm
        turned = turned_by(triangle, share[:, None] * edges_mm, count)
        offset = self.rest_mm - at.points.sample(rest, driver.triangles)
        strength = hold * at.share
        beside = turned_by(at.points.triangle, strength[:, None] * offset, count)
        sample = at.points.matrix(driver.triangles, len(rest))
        sums = GradientSums(
            rest, driver.triangles, gather @ turned + beside, sparse.diags_array(strength) @ sample
        )
        still = gather @ ((1.0 - share)[:, None] * edges_mm)
        return sums, still + (hold - strength)[:, None] * self.rest_mm

    def gaps_mm(self, driver_mm: np.ndarray) -> np.ndarray:
        """Distances (K,) of the lips of a driving mesh driver_mm (V, 3) along the head's up axis."""
        return self._driver_pairs @ driver_mm[:, _UP]

    def own_gaps_mm(self, pose_mm: np.ndarray) -> np.ndarray:
        """The same (K,) of a pose_mm (Y, 3) of the surface."""
        return self._pairs @ pose_mm[:, _UP]

    def follow(self, driver_mm: np.ndarray, gaps_mm: np.ndarray) -> np.ndarray:
        """The pose (Y, 3) for driver_mm (V, 3) of the driving mesh, with gaps_mm (K,) between the lips."""
        right = self._right.of(driver_mm) + self._still
        pose = np.empty_like(right)
        pose[:, _ACROSS] = self._across.solve(right[:, _ACROSS])
        pose[:, _UP] = self._along.solve(right[:, [_UP]] + (self._meet @ gaps_mm)[:, None])[:, 0]
        return pose


def _bind(
    surface: Surface, points: np.ndarray, normals: np.ndarray, own: np.ndarray, sides: np.ndarray
) -> Bound:
    """Nearest places of a driving mesh to points (N, 3), facing alike and of the same lip."""
    found = surface.closest(points, normals, _COSINE, own, sides)
    anyhow = surface.closest(points)
    assert found.distance_mm is not None and anyhow.distance_mm is not None
    lost = ~found.bound | (found.distance_mm > anyhow.distance_mm + _FARTHER_MM)
    triangle = np.where(lost, anyhow.triangle, found.triangle)
    barycentric = np.where(lost[:, None], anyhow.barycentric, found.barycentric)
    distance = np.where(lost, anyhow.distance_mm, found.distance_mm)
    share = np.exp(-((distance / _FADE_MM) ** 2))
    return Bound(SurfacePoints(triangle, barycentric, distance), share)


def _lip_sides(model: FaceModel) -> np.ndarray:
    """(V,) +1 upper lip, -1 lower, with the inside of the mouth."""
    return lip_sides_by_distance(Mesh(model.neutral_mm, model.triangles), model.regions, _CORNER_MM)


def _lip_pairs(
    driver: FaceModel, labels: FaceModel, own: np.ndarray
) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """(K, V) and (K, Y): upper minus lower lip at places along the driving mesh's inner contour.

    `own` (Y,) says which lip each vertex of the surface belongs to. Next to the corners, where both
    places have a vertex in common, there are none.
    """
    halves = contour_halves(driver.neutral_mm, driver.landmarks, driver.inner_contour)
    shares = (np.arange(_PAIRS) + 0.5) / _PAIRS
    surface, sides = (
        Surface(labels.neutral_mm, labels.triangles),
        triangle_sides(labels.triangles, own),
    )
    theirs, ours = [], []
    for side, half in zip((1, -1), halves, strict=True):
        place = _along(driver.neutral_mm, half, shares)
        theirs.append(place)
        points = place @ driver.neutral_mm
        at = surface.closest(points, sides=np.full(len(points), side), triangle_sides=sides)
        ours.append(at.matrix(labels.triangles, labels.n_vertices))
    apart = [
        np.asarray(abs(a).multiply(abs(b)).sum(axis=1)).ravel() == 0 for a, b in (theirs, ours)
    ]
    kept = np.flatnonzero(apart[0] & apart[1])
    return sparse.csr_matrix((theirs[0] - theirs[1])[kept]), sparse.csr_matrix(
        (ours[0] - ours[1])[kept]
    )


def _along(vertices: np.ndarray, path: np.ndarray, places: np.ndarray) -> sparse.csr_matrix:
    """(K, V): the points of a path (n,) of vertices at shares `places` (K,) of its length."""
    lengths = lengths_along(vertices[path])
    at = places * lengths[-1]
    left = np.clip(np.searchsorted(lengths, at, side="right") - 1, 0, len(path) - 2)
    share = (at - lengths[left]) / np.maximum(lengths[left + 1] - lengths[left], 1e-12)
    rows = np.concatenate([np.arange(len(at))] * 2)
    columns = np.concatenate([path[left], path[left + 1]])
    values = np.concatenate([1.0 - share, share])
    return sparse.csr_matrix((values, (rows, columns)), shape=(len(at), len(vertices)))
