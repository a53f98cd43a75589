"""Where one lip passes through the other: edges of one that enter triangles of the other.

Exact for the meshes as they are, where the distance to the nearest vertex is only nearly so.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import normalised, triangle_cross, unique_edges
from vermilion.geometry.raycast import RayCaster
from vermilion.multiview.contact import lips_of

#: The inside of the mouth further than this from where the lips meet does not count (mm).
_INSIDE_MM = 8.0


@dataclass(frozen=True)
class Crossings:
    """Edges that enter the other lip.

    Attributes:
        inside: (n,) the vertex that lies inside.
        triangle: (n, 3) corners of the triangle that the edge enters.
        barycentric: (n, 3) there.
        normal: (n, 3) of that triangle, outwards.
        depth_mm: (n,) of the vertex below the triangle's plane.
    """

    inside: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    normal: np.ndarray
    depth_mm: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> Crossings:
        return Crossings(*(getattr(self, f.name)[chosen] for f in fields(self)))

    @property
    def deepest_mm(self) -> float:
        """Depth of the vertex that lies deepest; 0 where there is none."""
        return float(self.depth_mm.max(initial=0.0))


class LipCrossings:
    """The two lips of a topology, without the corners of the mouth, where they are one surface.

    Attributes:
        vertices: (K,) ids that take part, ascending.
    """

    def __init__(self, face: FaceModel):
        lips = lips_of(face)
        red = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
        meeting = face.neutral_mm[face.inner_contour]
        sides = []
        for ids in (lips.upper, lips.lower):
            distance = np.linalg.norm(face.neutral_mm[ids, None] - meeting, axis=2).min(axis=1)
            member = np.zeros(face.n_vertices, dtype=bool)
            member[ids[red[ids] | (distance < _INSIDE_MM)]] = True
            sides.append(face.triangles[member[face.triangles].all(axis=1)])
        self.vertices = np.unique(np.concatenate([side.ravel() for side in sides]))
        self._triangles = [np.searchsorted(self.vertices, side) for side in sides]
        self._edges = [_both_ways(side) for side in self._triangles]

    def find(self, vertices_mm: np.ndarray) -> Crossings:
        """Crossings of a mesh `vertices_mm` (V, 3), any frame; only rows `vertices` need be right."""
        lips = vertices_mm[self.vertices]
        lips = lips - lips.mean(axis=0)  # the ray caster has single precision
        upper, lower = (
            _entering(lips, self._edges[mine], self._triangles[1 - mine]) for mine in (0, 1)
        )
        inside, triangle, *others = (
            np.concatenate([getattr(upper, f.name), getattr(lower, f.name)]) for f in fields(upper)
        )
        return Crossings(self.vertices[inside], self.vertices[triangle], *others)


def _both_ways(triangles: np.ndarray) -> np.ndarray:
    edges = unique_edges(triangles) if len(triangles) else np.zeros((0, 2), dtype=np.int64)
    return np.concatenate([edges, edges[:, ::-1]])


def _entering(vertices: np.ndarray, edges: np.ndarray, triangles: np.ndarray) -> Crossings:
    """Edges (E, 2) from outside through the front of a triangle (T, 3)."""
    if len(edges) == 0 or len(triangles) == 0:
        ids, places = np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3))
        return Crossings(ids[:, 0], ids, places, places, places[:, 0])
    along = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    directions = along / np.maximum(length, 1e-9)[:, None]
    hits = RayCaster(vertices, triangles).cast(vertices[edges[:, 0]], directions)
    met = hits.hit & (hits.distance_mm < length)
    corners = triangles[hits.triangle[met]]
    normal = normalised(triangle_cross(vertices, corners))
    along, ends = along[met], edges[met, 1]
    depth = -((vertices[ends] - vertices[corners[:, 0]]) * normal).sum(axis=1)
    enters = ((along * normal).sum(axis=1) < 0) & (depth > 0)
    return Crossings(
        ends, corners, hits.barycentric[met].astype(float), normal, depth,
    )[enters]  # fmt: skip
