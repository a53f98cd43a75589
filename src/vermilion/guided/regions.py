"""Inner lips (predicted) and mouth region (trusted): two sets of triangles (Guided18 figure 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.contours import edge_graph, geodesic_distance
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import adjacency, connected_parts, unique_edges
from vermilion.storage.errors import InputError

#: Defaults, mm along the surface from the lips' inner edge. What other sizes cost: docs/guided.md.
INNER_MM, INSIDE_MM, MOUTH_MM = 12.0, 8.0, 40.0


@dataclass(frozen=True)
class GuidedRegions:
    """The parts of one topology that the method tells apart.

    Attributes:
        triangles: (T, 3) of the topology.
        n_vertices: V.
        predicted: (n,) ids of the inner lips' triangles.
        trusted: (m,) ids of the mouth region's triangles.
        border: (b,) vertices of the inner lips that the rest of the face holds in place.
        free: (f,) the other vertices of the inner lips.
        followers: (q,) vertices of parts that hang on the inner lips alone, as the inside of the
            mouth does; they are neither predicted nor trusted and go where the lips go.
    """

    triangles: np.ndarray
    n_vertices: int
    predicted: np.ndarray
    trusted: np.ndarray
    border: np.ndarray
    free: np.ndarray
    followers: np.ndarray

    @property
    def inner_vertices(self) -> np.ndarray:
        """Vertices of the predicted triangles, ascending."""
        return np.union1d(self.border, self.free)

    @property
    def mouth_vertices(self) -> np.ndarray:
        """Vertices of the mouth region, the inner lips and what hangs on them, ascending."""
        trusted = np.unique(self.triangles[self.trusted])
        return np.union1d(np.union1d(self.inner_vertices, trusted), self.followers)

    def restricted(self, vertices: np.ndarray) -> GuidedRegions:
        """The same regions on a part of the mesh, renumbered.

        Args:
            vertices: (U,) ids that are kept, ascending; all of `mouth_vertices` are among them.
        """
        number = np.full(self.n_vertices, -1)
        number[vertices] = np.arange(len(vertices))
        kept = (number >= 0)[self.triangles].all(axis=1)
        triangle = np.cumsum(kept) - 1
        return GuidedRegions(
            number[self.triangles[kept]], len(vertices), triangle[self.predicted],
            triangle[self.trusted], number[self.border], number[self.free],
            number[self.followers],
        )  # fmt: skip

    def arrays(self) -> dict[str, np.ndarray]:
        """What `from_arrays` needs, for a `.npz`: triangles (T, 3), predicted (n,), trusted (m,)."""
        return {
            "triangles": np.asarray(self.triangles, dtype=np.int32),
            "n_vertices": np.array(self.n_vertices, dtype=np.int64),
            "predicted": self.predicted,
            "trusted": self.trusted,
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> GuidedRegions:
        """The regions of what `arrays` gave: triangles (T, 3), predicted (n,), trusted (m,)."""
        return regions_of_triangles(
            arrays["triangles"],
            int(arrays["n_vertices"]),
            arrays["predicted"],
            arrays["trusted"],
        )


def regions_of_face(
    face: FaceModel,
    inner_mm: float = INNER_MM,
    inside_mm: float = INSIDE_MM,
    mouth_mm: float = MOUTH_MM,
) -> GuidedRegions:
    """Regions by distance along the edges from the line where the lips meet.

    Args:
        face: names the inside of the mouth, the face, and the lips' inner edge.
        inner_mm: how far the inner lips reach over the outside of the lips.
        inside_mm: how far they reach into the mouth.
        mouth_mm: how far the mouth region reaches over the face.

    Raises:
        InputError: the sizes leave one of the regions empty.
    """
    graph = edge_graph(face.neutral_mm, face.triangles)
    distance = geodesic_distance(graph, face.inner_contour)
    lips = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
    inside = face.regions["mouth_inner"] & ~lips
    inner = distance <= np.where(inside, inside_mm, inner_mm)
    outside = (face.regions["face"] | lips) & ~inside
    mouth = outside & (distance <= mouth_mm)
    return regions_of_vertices(face.triangles, face.n_vertices, inner, mouth)


def regions_of_vertices(
    triangles: np.ndarray, n_vertices: int, inner: np.ndarray, mouth: np.ndarray
) -> GuidedRegions:
    """Regions of any topology from two lists of vertices.

    Args:
        triangles: (T, 3).
        n_vertices: V.
        inner: vertices of the inner lips, ids or (V,) bool. A triangle is predicted where all its
            corners are in the list.
        mouth: vertices of the mouth region, ids or (V,) bool; the inner lips may be in it. A
            triangle is trusted where all its corners are in one of the lists and it is not
            predicted.

    Raises:
        InputError: ids outside the mesh, an empty region, or inner lips without a border.
    """
    in_inner = _as_mask(inner, n_vertices, "inner lips")
    in_mouth = _as_mask(mouth, n_vertices, "mouth region") | in_inner
    predicted = in_inner[triangles].all(axis=1)
    trusted = in_mouth[triangles].all(axis=1) & ~predicted
    ids = np.flatnonzero(predicted), np.flatnonzero(trusted)
    return regions_of_triangles(triangles, n_vertices, *ids)


def regions_of_triangles(
    triangles: np.ndarray, n_vertices: int, predicted: np.ndarray, trusted: np.ndarray
) -> GuidedRegions:
    """Regions from two lists of triangles: predicted (n,) and trusted (m,) ids.

    Raises:
        InputError: an empty or overlapping region, or inner lips that nothing holds in place.
    """
    for ids, name in ((predicted, "inner lips"), (trusted, "mouth region")):
        if len(ids) == 0:
            raise InputError(
                f"no triangle in the {name}",
                "at least one",
                "Make the region larger, or name more of its vertices.",
            )
    if len(np.intersect1d(predicted, trusted)):
        raise InputError(
            "triangles that are both predicted and trusted",
            "two sets without a common triangle",
            "Take the inner lips out of the mouth region.",
        )
    corners = np.unique(triangles[predicted])
    of_inner = np.zeros(n_vertices, dtype=bool)
    of_inner[corners] = True
    followers = _followers(triangles, of_inner, np.unique(triangles[trusted]))
    held = ~of_inner & ~followers
    near_held = (adjacency(triangles, n_vertices) @ held.astype(float)) > 0
    border, free = corners[near_held[corners]], corners[~near_held[corners]]
    _check_held(triangles[predicted], n_vertices, border, free)
    return GuidedRegions(
        np.asarray(triangles), n_vertices, np.asarray(predicted, dtype=np.int64),
        np.asarray(trusted, dtype=np.int64), border, free, np.flatnonzero(followers),
    )  # fmt: skip


def movable_vertices(regions: GuidedRegions) -> np.ndarray:
    """Vertices that a refinement may move, (N,) ascending: the mouth region without its rim.

    The rim are the mouth's vertices that have a neighbour outside it.
    """
    inside = np.zeros(regions.n_vertices, dtype=bool)
    inside[regions.mouth_vertices] = True
    neighbours = adjacency(regions.triangles, regions.n_vertices)
    return np.flatnonzero(inside & ~((neighbours @ (~inside).astype(float)) > 0))


def rim_fade(regions: GuidedRegions, rings: int = 4) -> np.ndarray:
    """(V,) in [0, 1]: 0 at the mouth region's rim and outside it, 1 from `rings` edges inside on."""
    inside = np.zeros(regions.n_vertices, dtype=bool)
    inside[movable_vertices(regions)] = True
    neighbours = adjacency(regions.triangles, regions.n_vertices)
    result = np.zeros(regions.n_vertices)
    for _ in range(rings):
        result += inside / rings
        inside = inside & ~((neighbours @ (~inside).astype(float)) > 0)
    return result


def _as_mask(vertices: np.ndarray, n_vertices: int, name: str) -> np.ndarray:
    vertices = np.asarray(vertices)
    if vertices.dtype == bool and vertices.shape == (n_vertices,):
        return vertices
    if vertices.dtype == bool or (len(vertices) and not np.issubdtype(vertices.dtype, np.integer)):
        raise InputError(
            f"{vertices.dtype} of shape {vertices.shape} for the {name}",
            f"vertex ids, or ({n_vertices},) bool",
            "Give the vertices as whole numbers.",
        )
    if len(vertices) and not (vertices.min() >= 0 and vertices.max() < n_vertices):
        raise InputError(
            f"vertices {vertices.min()} to {vertices.max()} in the {name}",
            f"numbers from 0 to {n_vertices - 1}",
            "Check that the list was made for this topology.",
        )
    mask = np.zeros(n_vertices, dtype=bool)
    mask[vertices.astype(np.int64)] = True
    return mask


def _followers(triangles: np.ndarray, of_inner: np.ndarray, trusted: np.ndarray) -> np.ndarray:
    """Vertices of the parts that touch the inner lips and nothing that is trusted, (V,) bool."""
    n_vertices = len(of_inner)
    edges = unique_edges(triangles)
    outside = edges[~of_inner[edges].any(axis=1)]
    part = connected_parts(outside, n_vertices)
    count = part.max() + 1
    crossing = edges[of_inner[edges].sum(axis=1) == 1]
    touching = np.zeros(count, dtype=bool)
    touching[part[crossing[~of_inner[crossing]]]] = True
    touching[part[trusted[~of_inner[trusted]]]] = False
    # A mouth region one triangle wide has no vertex of its own: the largest part is the face.
    touching[np.bincount(part[~of_inner], minlength=count).argmax()] = False
    return touching[part] & ~of_inner


def _check_held(
    predicted: np.ndarray, n_vertices: int, border: np.ndarray, free: np.ndarray
) -> None:
    """Every connected piece of the inner lips needs a vertex on the border."""
    part = connected_parts(unique_edges(predicted), n_vertices)
    loose = np.setdiff1d(part[free], part[border])
    if len(loose):
        raise InputError(
            f"{np.isin(part[free], loose).sum()} vertices of the inner lips without a border",
            "inner lips that the mouth region surrounds",
            "Make the inner lips smaller, or remove triangles that are not joined to the mouth.",
        )
