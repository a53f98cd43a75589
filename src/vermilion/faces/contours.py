"""Lip contours as closed vertex loops, and what they bound: geodesic regions of a face mesh."""

from __future__ import annotations

import itertools

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import connected_parts, unique_edges
from vermilion.geometry.polylines import lengths_along

#: Points of the 66-point scheme (DESIGN) round the mouth, each loop in order from the subject's
#: right corner over the upper lip to the left corner and back under the lower lip.
OUTER_LOOP = (58, 48, 49, 50, 51, 52, 62, 53, 54, 55, 56, 57)
INNER_LOOP = (58, 59, 60, 61, 62, 63, 64, 65)
RIGHT_CORNER, LEFT_CORNER = 58, 62
UPPER_MIDDLE = 50


def edge_graph(
    vertices_mm: np.ndarray, triangles: np.ndarray, cost: np.ndarray | None = None
) -> sparse.csr_matrix:
    """Graph of edge lengths, (V, V) symmetric, mm.

    `vertices_mm` (V, 3), `triangles` (T, 3). `cost` (V,) multiplies each edge by its ends' mean.
    """
    edges = unique_edges(triangles)
    length = np.linalg.norm(vertices_mm[edges[:, 0]] - vertices_mm[edges[:, 1]], axis=1)
    length = np.maximum(length, 1e-6)
    if cost is not None:
        length = length * 0.5 * (cost[edges[:, 0]] + cost[edges[:, 1]])
    n_vertices = len(vertices_mm)
    graph = sparse.coo_matrix((length, (edges[:, 0], edges[:, 1])), shape=(n_vertices,) * 2)
    return (graph + graph.T).tocsr()


def open_path(graph: sparse.spmatrix, waypoints: np.ndarray) -> np.ndarray:
    """Vertices (n,) of the path through `waypoints` (m,) in order, by shortest paths along edges.

    Raises ValueError where the edges lead from none to the next.
    """
    waypoints = np.asarray(waypoints)
    _, previous = csgraph.dijkstra(graph, indices=waypoints[:-1], return_predecessors=True)
    whole = [waypoints[:1]]
    for index, (start, end) in enumerate(itertools.pairwise(waypoints)):
        path = [end]
        while path[-1] != start:
            step = previous[index, path[-1]]
            if step < 0:
                raise ValueError(f"no path along the edges from vertex {start} to vertex {end}")
            path.append(step)
        whole.append(np.array(path[-2::-1]))
    return np.concatenate(whole).astype(np.int32)


def closed_loop(graph: sparse.spmatrix, waypoints: np.ndarray) -> np.ndarray:
    """Closed vertex loop (n,) through `waypoints` (m,) in order, by shortest paths along edges."""
    return open_path(graph, np.append(waypoints, waypoints[0]))[:-1]


def smooth_loop(
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    waypoints: np.ndarray,
    left_corner: int,
    tolerance_mm: float = 0.4,
) -> np.ndarray:
    """Closed vertex loop (n,) through the waypoints that keeps to splines through them.

    A mouth has corners, so there are two splines: from the first waypoint over the upper lip to
    waypoint number `left_corner`, and back under the lower lip. Shortest paths alone would cut
    across rows of the mesh where the loop bends; here the cost of an edge grows with its distance
    from the splines.

    Args:
        vertices_mm: (V, 3) mm.
        triangles: (T, 3).
        waypoints: (m,) vertices.
        left_corner: number of the waypoint at the subject's left corner.
        tolerance_mm: distance from the splines at which the cost doubles.
    """
    closed = np.append(waypoints, waypoints[0])
    halves = (closed[: left_corner + 1], closed[left_corner:])
    curve = np.concatenate([_spline(vertices_mm[half]) for half in halves])
    distance, _ = cKDTree(curve).query(vertices_mm)
    graph = edge_graph(vertices_mm, triangles, cost=1.0 + (distance / tolerance_mm) ** 2)
    return closed_loop(graph, waypoints)


def without_spurs(loop: np.ndarray) -> np.ndarray:
    """A closed vertex loop (m,) without places where it runs to a vertex and straight back.

    `loop` (n,) vertices.
    """
    vertices = loop.tolist()
    index = 0
    while index < len(vertices) and len(vertices) > 3:
        following = vertices[(index + 1) % len(vertices)]
        if vertices[index - 1] == following:
            for drop in sorted({index, (index + 1) % len(vertices)}, reverse=True):
                del vertices[drop]
            index = max(index - 2, 0)
        else:
            index += 1
    return np.array(vertices, dtype=loop.dtype)


def _spline(knots: np.ndarray) -> np.ndarray:
    """Dense points of the natural cubic spline through the knots, (60 n, 3)."""
    from scipy.interpolate import CubicSpline

    chord = lengths_along(knots)
    places = np.linspace(0, chord[-1], 60 * len(knots))
    return CubicSpline(chord, knots, bc_type="natural")(places)


def contour_halves(
    neutral_mm: np.ndarray, landmarks: np.ndarray, loop: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A lip contour, which may start anywhere and run either way, as two open vertex paths.

    Args:
        neutral_mm: (V, 3) head frame, mm.
        landmarks: (66,) vertex ids.
        loop: (N,) vertex ids of the contour.

    Returns:
        two arrays (n,) of vertex ids, the upper lip's path and the lower lip's, each from the subject's
        right corner to the left one, both corners included.
    """
    points = neutral_mm[loop]
    right, left = (
        int(np.argmin(np.linalg.norm(points - neutral_mm[landmarks[corner]], axis=1)))
        for corner in (RIGHT_CORNER, LEFT_CORNER)
    )
    loop, points = np.roll(loop, -right), np.roll(points, -right, axis=0)
    turn = (left - right) % len(loop)
    if points[1:turn, 1].mean() < points[turn + 1 :, 1].mean():  # the lower lip comes first
        loop = np.roll(loop[::-1], 1)
        turn = len(loop) - turn
    return loop[: turn + 1], np.append(loop[turn:], loop[0])[::-1]


def geodesic_distance(
    graph: sparse.spmatrix, sources: np.ndarray, limit_mm: float = np.inf
) -> np.ndarray:
    """Distance along edges of every vertex to the nearest source, (V,) mm; inf beyond the limit, or where apart.

    `sources` (n,) vertices.
    """
    return csgraph.dijkstra(graph, indices=np.unique(sources), min_only=True, limit=limit_mm)


def enclosed(triangles: np.ndarray, n_vertices: int, loop: np.ndarray, seed: int) -> np.ndarray:
    """Vertices on the same side of a closed loop as `seed`, (V,) bool, the loop not counted.

    `triangles` (T, 3), `loop` (n,) vertices.
    """
    edges = unique_edges(triangles)
    on_loop = np.zeros(n_vertices, dtype=bool)
    on_loop[loop] = True
    edges = edges[~on_loop[edges].any(axis=1)]
    part = connected_parts(edges, n_vertices)
    return (part == part[seed]) & ~on_loop


def upper_side(
    graph: sparse.spmatrix, outer: np.ndarray, inner: np.ndarray, landmarks: np.ndarray
) -> np.ndarray:
    """Vertices of the upper lip's side (True) and of the lower lip's side, (V,) bool.

    A vertex belongs to the side whose part of the two contours is nearer along the edges. The loops
    `outer` (n,) and `inner` (m,) may start anywhere and run either way: `landmarks` (66,) tell where
    their parts are.
    """
    ends = landmarks[[RIGHT_CORNER, LEFT_CORNER, UPPER_MIDDLE]]
    distance = csgraph.dijkstra(graph, indices=ends)
    upper, lower = [], []
    for loop in (outer, inner):
        start, turn, middle = (int(np.argmin(row[loop])) for row in distance)
        loop = np.roll(loop, -start)
        turn, middle = (turn - start) % len(loop), (middle - start) % len(loop)
        first, second = loop[1:turn], loop[turn + 1 :]
        upper.append(first if middle < turn else second)
        lower.append(second if middle < turn else first)
    to_upper = geodesic_distance(graph, np.concatenate(upper))
    to_lower = geodesic_distance(graph, np.concatenate(lower))
    return to_upper <= to_lower
