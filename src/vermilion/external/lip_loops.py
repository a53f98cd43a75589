"""Lip contours of another topology: closed loops of its edges along those of a registered face model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from vermilion.faces.contours import (
    LEFT_CORNER,
    RIGHT_CORNER,
    contour_halves,
    edge_graph,
    geodesic_distance,
    open_path,
    without_spurs,
)
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh, vertex_normals
from vermilion.geometry.polylines import evenly_along

#: Points of a half of the model's contour, to which the path keeps.
_DENSE = 200
#: Distance from the model's contour at which the cost of an edge doubles, in lengths of an edge there.
_TOLERANCE = 0.3
#: Contours that lie farther from the model's in the mean are no lips, mm.
_OFF_MM = 3.0
#: A vertex whose normal is turned by a right angle from the model's counts as this much farther, mm.
_TURNED_MM = 4.0


@dataclass(frozen=True)
class LipLoops:
    """Both contours on the other topology.

    Attributes:
        outer, inner: (n,), (m,) int32 closed loops of vertices. Both go through the two corners.
        upper, lower: (V,) bool, vertices nearer to the upper or lower half of the outer loop along the
            edges; both False at the corners.
    """

    outer: np.ndarray
    inner: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


def lip_loops(model: FaceModel, registered: Mesh, mesh: Mesh) -> LipLoops:
    """Follow the contours of a registered model along the edges of a mesh.

    The lips may touch: once the outer loop is known, the inner one runs on the upper lip's side of the
    mesh from corner to corner, and back on the lower lip's.

    Args:
        model: with the contours and landmarks.
        registered: the model laid over the mesh.
        mesh: the other topology, V vertices, in the same frame, mm.

    Raises:
        ValueError: the mesh has no closed edges round the mouth.
    """
    graph = edge_graph(mesh.vertices_mm, mesh.triangles)
    corners = [
        _nearest(mesh, registered, [model.landmarks[c]], np.ones(len(mesh.vertices_mm), bool))[0]
        for c in (RIGHT_CORNER, LEFT_CORNER)
    ]
    everywhere = np.ones(len(mesh.vertices_mm), dtype=bool)
    halves = contour_halves(model.neutral_mm, model.landmarks, model.outer_contour)
    above, below = (_half(mesh, registered, h, corners, everywhere, graph) for h in halves)
    outer = without_spurs(np.concatenate([above[:-1], below[::-1][:-1]]))
    to_upper, to_lower = (
        geodesic_distance(graph, above[1:-1]),
        geodesic_distance(graph, below[1:-1]),
    )
    upper, lower = to_upper < to_lower, to_lower < to_upper
    halves = contour_halves(model.neutral_mm, model.landmarks, model.inner_contour)
    above, below = (
        _half(mesh, registered, half, corners, side, graph)
        for half, side in zip(halves, (upper, lower), strict=True)
    )
    inner = without_spurs(np.concatenate([above[:-1], below[::-1][:-1]]))
    if min(len(outer), len(inner)) < 6:
        raise ValueError(f"contours of {len(outer)} and {len(inner)} vertices")
    for loop, name in ((outer, model.outer_contour), (inner, model.inner_contour)):
        line = evenly_along(registered.vertices_mm[np.append(name, name[0])], 2 * _DENSE)
        off = float(cKDTree(line).query(mesh.vertices_mm[loop])[0].mean())
        if off > _OFF_MM:
            raise ValueError(f"the nearest lie {off:.1f} mm off")
    return LipLoops(outer, inner, upper, lower)


def _half(
    mesh: Mesh,
    registered: Mesh,
    half: np.ndarray,
    corners: list[int],
    side: np.ndarray,
    graph: sparse.csr_matrix,
) -> np.ndarray:
    """Vertices of the mesh along a half (n,) of a contour, from corner to corner, on one side alone."""
    line = evenly_along(registered.vertices_mm[half], _DENSE)
    distance, _ = cKDTree(line).query(mesh.vertices_mm)
    allowed = side.copy()
    allowed[corners] = True
    length = float(np.median(graph.data[np.repeat(distance < 6.0, np.diff(graph.indptr))]))
    cost = 1.0 + (distance / (_TOLERANCE * length)) ** 2
    costly = sparse.diags_array(cost) @ graph + graph @ sparse.diags_array(cost)
    keep = sparse.diags_array(allowed.astype(float))
    costly = sparse.csr_matrix(keep @ costly @ keep)
    costly.eliminate_zeros()
    return open_path(costly, np.array(corners))


def _nearest(
    mesh: Mesh, registered: Mesh, ids: np.ndarray | list[int], allowed: np.ndarray
) -> list[int]:
    """The allowed (V,) vertex of the mesh nearest to each of the model's `ids`, normals alike."""
    normals = vertex_normals(mesh.vertices_mm, mesh.triangles)
    wanted = vertex_normals(registered.vertices_mm, registered.triangles)[ids]
    distance = np.linalg.norm(mesh.vertices_mm[None] - registered.vertices_mm[ids][:, None], axis=2)
    distance = distance + _TURNED_MM * (1.0 - wanted @ normals.T)
    return np.where(allowed, distance, np.inf).argmin(axis=1).tolist()
