"""Facts about triangle meshes."""

import numpy as np

from vermilion.geometry.mesh import (
    adjacency,
    boundary_edges,
    submesh,
    triangle_areas,
    triangle_normals,
    unique_edges,
    vertex_areas,
    vertex_normals,
)


def grid(n=6, size_mm=5.0):
    """A flat square of 2 (n - 1)^2 triangles in the plane z = 0, facing +z."""
    x, y = np.meshgrid(np.linspace(0, size_mm, n), np.linspace(0, size_mm, n))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1)
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    return vertices, triangles


def test_flat_square_has_its_area_and_normal():
    vertices, triangles = grid()
    assert np.isclose(triangle_areas(vertices, triangles).sum(), 25.0)
    assert np.isclose(vertex_areas(vertices, triangles).sum(), 25.0)
    assert np.allclose(triangle_normals(vertices, triangles), [0, 0, 1])
    assert np.allclose(vertex_normals(vertices, triangles), [0, 0, 1])


def test_euler_characteristic_and_boundary_of_a_disc():
    vertices, triangles = grid()
    edges = unique_edges(triangles)
    assert len(vertices) - len(edges) + len(triangles) == 1
    assert len(boundary_edges(triangles)) == 4 * 5
    assert adjacency(triangles, len(vertices)).nnz == 2 * len(edges)


def test_submesh_keeps_geometry():
    vertices, triangles = grid()
    ids, cropped = submesh(triangles, vertices[:, 0] <= 2.5)
    assert cropped.max() == len(ids) - 1
    assert np.isclose(triangle_areas(vertices[ids], cropped).sum(), 2.0 * 5.0)
