"""Cotangent weights of edges and the quadratic energy that they give."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.geometry.mesh import vertex_areas

_COTANGENT_RANGE = (0.02, 50.0)


def cotangents(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Half the cotangent of the angle opposite each edge, kept positive.

    Args:
        vertices: (V, 3), any unit and frame.
        triangles: (T, 3).

    Returns:
        (T, 3) of the edges 12, 20, 01 of each triangle.
    """
    weights = np.empty((len(triangles), 3))
    for k in range(3):
        a, b, c = (vertices[triangles[:, (k + i) % 3]] for i in range(3))
        along, across = b - a, c - a
        area = np.linalg.norm(np.cross(along, across), axis=1)
        cotangent = (along * across).sum(axis=1) / np.maximum(area, 1e-12)
        weights[:, k] = 0.5 * np.clip(cotangent, *_COTANGENT_RANGE)
    return weights


def edge_stiffness(
    triangles: np.ndarray, weights: np.ndarray, n_vertices: int
) -> sparse.csr_matrix:
    """Matrix of the energy sum w_ij |x_i - x_j|^2 over the edges of a mesh.

    Args:
        triangles: (T, 3).
        weights: (T, 3) of the edges 12, 20, 01 of each triangle.
        n_vertices: V.

    Returns:
        (V, V) sparse, symmetric.
    """
    first = triangles[:, [1, 2, 0]].ravel()
    second = triangles[:, [2, 0, 1]].ravel()
    values = weights.ravel()
    rows = np.concatenate([first, second, first, second])
    columns = np.concatenate([first, second, second, first])
    data = np.concatenate([values, values, -values, -values])
    return sparse.csr_matrix((data, (rows, columns)), shape=(n_vertices, n_vertices))


def bending_stiffness(
    vertices: np.ndarray, triangles: np.ndarray, free: np.ndarray
) -> sparse.csr_matrix:
    """Matrix of a thin plate's energy, |Laplacian x|^2 over the surface, of some vertices.

    A membrane (`edge_stiffness`) that is pulled at a point rises to a tip there; a plate bends evenly.

    Args:
        vertices: (V, 3), mm.
        triangles: (T, 3).
        free: (N,) ids of the vertices that move; the others stay.

    Returns:
        (N, N) sparse, symmetric, 1 / mm2 times the unit of `edge_stiffness`.
    """
    moves = np.zeros(len(vertices), dtype=bool)
    moves[free] = True
    near = triangles[moves[triangles].any(axis=1)]
    stiffness = edge_stiffness(near, cotangents(vertices, near), len(vertices))[:, free]
    areas = np.maximum(vertex_areas(vertices, near), 1e-6)
    return sparse.csr_matrix(stiffness.T @ sparse.diags_array(1.0 / areas) @ stiffness)
