"""Where the landmarks of a set lie on a face model: faces and barycentric coordinates.

The places of `ibug66` are vertices that every face model names. Those of another set are found once a
model: the detector looks at the model's bare neutral, its shape is warped so that the points it shares with
`ibug66` fall on that set's vertices, and the others go to the closest point of the surface. Points of
the lips' rings lie on the model's own lip contours, each at its share of the way along them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.faces.contours import contour_halves
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.polylines import lengths_along
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.landmarks.sets import LandmarkSet, set_of
from vermilion.storage.arrays import read_arrays, write_arrays

_HIDDEN = ("mouth_inner", "teeth", "eyes")  # regions that no landmark lies on


@dataclass(frozen=True)
class LandmarkPlaces:
    """The landmarks of a set on the topology of a face model.

    Attributes:
        landmark_set: the set, of N points.
        points: (N,) places; unbound for points that the model has no surface for (irises).
        triangles: (T, 3) of the face model.
    """

    landmark_set: LandmarkSet
    points: SurfacePoints
    triangles: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """(N,) bool: points that have a place."""
        return self.points.bound

    def of(self, field: np.ndarray) -> np.ndarray:
        """Values (..., N, d) float64 of a field (..., V, d) on the model's vertices; zero where unknown."""
        return np.where(self.known[:, None], self.points.sample(field, self.triangles), 0.0)

    def arrays(self) -> dict[str, np.ndarray]:
        """As arrays, from which `from_arrays` makes the same: triangle (N,), barycentric (N, 3)."""
        return {
            "landmark_set": np.array(self.landmark_set.name),
            "triangle": self.points.triangle,
            "barycentric": self.points.barycentric,
            "triangles": self.triangles.astype(np.int32),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> LandmarkPlaces:
        """Of what `arrays` gave: triangle (N,), barycentric (N, 3)."""
        points = SurfacePoints(arrays["triangle"], arrays["barycentric"])
        return cls(set_of(str(arrays["landmark_set"])), points, arrays["triangles"])

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, compressed=False, **self.arrays())

    @classmethod
    def load(cls, path: str | Path) -> LandmarkPlaces:
        """Read what `save` wrote. Raises InputError on a damaged file."""
        names = ("landmark_set", "triangle", "barycentric", "triangles")
        return cls.from_arrays(read_arrays(path, "file of landmark places", names))


def register_places(
    model: FaceModel, landmark_set: LandmarkSet, shape: np.ndarray
) -> tuple[LandmarkPlaces, np.ndarray]:
    """Places of a set on a face model, by the set's shape.

    Args:
        shape: (N, 3) points of a face at rest; scale and origin do not matter, axes as the head frame's.

    Returns:
        the places, and how far each point was moved onto the surface, (N,) mm; NaN where unknown.
    """
    from scipy.interpolate import RBFInterpolator  # only sets other than ibug66 come here

    ids, wanted = landmark_set.ibug66, model.neutral_mm[model.landmarks]
    placed = similarity_alignment(shape[ids], wanted).apply(shape)
    lips = _lip_places(model, landmark_set, placed)
    at_lips = lips.sample(model.neutral_mm, model.triangles)
    target = np.full_like(placed, np.nan)
    target[ids] = wanted
    target[lips.bound] = at_lips[lips.bound]
    anchors = np.isfinite(target).all(axis=1)
    # Linear in the distance: the smoothest warp of space (biharmonic) that hits the anchors.
    warp = RBFInterpolator(placed[anchors], (target - placed)[anchors], kernel="linear", degree=1)
    warped = placed + warp(placed)
    found, distance = _closest_skin(model, warped)
    named = SurfacePoints.at_vertices(model.landmarks, model.triangles)
    for points, source, rows in ((lips, lips.bound, lips.bound), (named, slice(None), ids)):
        found.triangle[rows] = points.triangle[source]
        found.barycentric[rows] = points.barycentric[source]
        distance[rows] = 0.0
    if "irises" in landmark_set.groups:
        irises = landmark_set.groups["irises"]
        found.triangle[irises], distance[irises] = -1, np.nan
    return LandmarkPlaces(landmark_set, found, model.triangles), distance


def _closest_skin(model: FaceModel, points: np.ndarray) -> tuple[SurfacePoints, np.ndarray]:
    """Closest points of the model's skin to points (N, 3) mm, and the distances (N,)."""
    hidden = np.any([model.regions[name] for name in _HIDDEN], axis=0)
    skin = np.flatnonzero(~hidden[model.triangles].any(axis=1))
    found = Surface(model.neutral_mm, model.triangles[skin]).closest(points)
    assert found.distance_mm is not None  # a search gives it
    return SurfacePoints(skin[found.triangle], found.barycentric), found.distance_mm


def _lip_places(model: FaceModel, landmark_set: LandmarkSet, shape: np.ndarray) -> SurfacePoints:
    """Places of the points of the outer and the inner ring, on the model's contours; others unbound."""
    n_points = landmark_set.n_points
    found = SurfacePoints(np.full(n_points, -1, dtype=np.int32), np.zeros((n_points, 3)))
    right, left = landmark_set.outer_corners
    for name, loop in (("inner", model.inner_contour), ("outer", model.outer_contour)):
        upper, lower = contour_halves(model.neutral_mm, model.landmarks, loop)
        for lip, path in (("upper", upper), ("lower", lower)):
            line = landmark_set.lip_line(lip, name)
            if right not in line:  # the model's contours share their corners, the set's do not
                line = np.concatenate([[right], line, [left]])
            points = _along(model, path, _shares(model, landmark_set, shape, line, path))
            found.triangle[line], found.barycentric[line] = points.triangle, points.barycentric
    return found


def _shares(
    model: FaceModel,
    landmark_set: LandmarkSet,
    shape: np.ndarray,
    line: np.ndarray,
    path: np.ndarray,
) -> np.ndarray:
    """How far along a path of vertices the points `line` lie, (n,) mm from the right corner.

    Points that are of `ibug66` lie where the model's landmarks do; between these the shape tells.
    """
    along = lengths_along(shape[line])
    vertex_of = dict(zip(landmark_set.ibug66.tolist(), model.landmarks.tolist(), strict=True))
    known = [row for row, point in enumerate(line.tolist()) if point in vertex_of]
    ends = model.neutral_mm[[vertex_of[int(line[row])] for row in known]]
    points = model.neutral_mm[path]
    nearest = np.linalg.norm(points[None] - ends[:, None], axis=2).argmin(axis=1)
    return np.interp(along, along[known], lengths_along(points)[nearest])


def _along(model: FaceModel, path: np.ndarray, along_mm: np.ndarray) -> SurfacePoints:
    """Places at lengths (n,) mm along a path of vertices."""
    lengths = lengths_along(model.neutral_mm[path])
    edge = np.clip(np.searchsorted(lengths, along_mm, side="right") - 1, 0, len(path) - 2)
    fraction = np.clip((along_mm - lengths[edge]) / (lengths[edge + 1] - lengths[edge]), 0.0, 1.0)
    return SurfacePoints.on_edges(path[edge], path[edge + 1], fraction, model.triangles)
