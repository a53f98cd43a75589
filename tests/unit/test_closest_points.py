"""Points on surfaces, and the search for the closest of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.unit.evaluation_face import sheet_face
from tests.unit.test_integration import sheet
from vermilion.geometry.closest_kernels import closest_of
from vermilion.geometry.closest_points import Surface, closest_barycentric
from vermilion.geometry.mesh import unique_edges, vertex_normals
from vermilion.geometry.surface_points import SurfacePoints


def test_closest_point_of_a_triangle_in_every_region():
    corners = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    cases = {
        (1.0, 1.0, 5.0): (1, 1, 0),  # over the inside
        (2.0, -3.0, 1.0): (2, 0, 0),  # beyond an edge
        (4.0, 4.0, 0.0): (2, 2, 0),  # beyond the long edge
        (-1.0, -1.0, 2.0): (0, 0, 0),  # beyond a corner
        (9.0, -1.0, 0.0): (4, 0, 0),
    }
    points = np.array(list(cases))
    weights = closest_barycentric(points, np.broadcast_to(corners, (5, 3, 3)))
    np.testing.assert_allclose(weights @ corners, np.array(list(cases.values())), atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_closest_point_agrees_with_brute_force(seed):
    """On triangles of all sizes and shapes, near the surface and far from it."""
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(90, 3)) * 10 ** rng.uniform(0, 1.5, (90, 1))
    triangles = rng.permutation(90).reshape(30, 3)
    points = rng.normal(scale=20.0, size=(60, 3))
    found = Surface(vertices, triangles).closest(points)
    pairs = np.repeat(points, 30, axis=0), np.tile(vertices[triangles], (60, 1, 1))
    weights = closest_barycentric(*pairs)
    away = np.linalg.norm(np.einsum("nk,nkd->nd", weights, pairs[1]) - pairs[0], axis=1)
    np.testing.assert_allclose(found.distance_mm, away.reshape(60, 30).min(axis=1), atol=1e-9)
    assert (found.barycentric >= 0).all()
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1.0)
    off = np.linalg.norm(found.sample(vertices, triangles) - points, axis=1)
    np.testing.assert_allclose(off, found.distance_mm, atol=1e-9)


def test_a_surface_that_faces_away_or_is_the_other_lip_is_no_match():
    lower, triangles, _ = sheet(8)
    upper = lower + np.array([0, 0, 2.0])
    both = np.concatenate([lower, upper])
    surface = Surface(both, np.concatenate([triangles, triangles[:, ::-1] + len(lower)]))
    points = lower + np.array([0, 0, 1.5])  # nearer to the upper sheet
    free = surface.closest(points)
    assert (free.triangle >= len(triangles)).mean() > 0.9
    facing = surface.closest(points, vertex_normals(lower, triangles), 0.3)
    assert np.all(facing.triangle < len(triangles))
    sides = np.repeat([-1, 1], len(triangles))
    same_lip = surface.closest(points, sides=np.full(len(points), -1), triangle_sides=sides)
    assert np.all(same_lip.triangle < len(triangles))


def test_a_bound_point_moves_with_its_mesh():
    vertices, triangles, _ = sheet(8)
    bound = Surface(vertices, triangles).closest(vertices[::3] + 0.4)
    rotation = Rotation.from_rotvec([0.2, 0.5, -0.1]).as_matrix()
    moved = bound.sample(vertices @ rotation.T + 7.0, triangles)
    np.testing.assert_allclose(
        moved, bound.sample(vertices, triangles) @ rotation.T + 7.0, atol=1e-9
    )
    matrix = bound.matrix(triangles, len(vertices))
    np.testing.assert_allclose(matrix @ vertices, bound.sample(vertices, triangles), atol=1e-12)
    np.testing.assert_allclose(
        SurfacePoints.at_vertices(np.array([3, 40]), triangles).sample(vertices, triangles),
        vertices[[3, 40]],
    )


def test_unbound_points_are_nan():
    vertices, triangles, _ = sheet(6)
    points = SurfacePoints(np.array([-1, 0]), np.full((2, 3), 1 / 3))
    assert np.isnan(points.sample(vertices, triangles)).all(axis=1).tolist() == [True, False]
    assert np.isinf(
        replace(points, distance_mm=np.zeros(2)).restricted(points.bound).distance_mm[0]
    )
    matrix = points.matrix(triangles, len(vertices)).toarray()
    assert not matrix[0].any() and matrix[1].sum() == 1.0


def test_points_on_edges_lie_between_their_ends():
    vertices, triangles, _ = sheet(8)
    start, end = unique_edges(triangles).T
    fraction = np.random.default_rng(0).uniform(size=len(start))
    for a, b in ((start, end), (end, start)):
        points = SurfacePoints.on_edges(a, b, fraction, triangles)
        wanted = vertices[a] * (1 - fraction)[:, None] + vertices[b] * fraction[:, None]
        assert (points.sample(vertices, triangles) == wanted).all()
        assert (np.sort(points.barycentric, axis=1)[:, 0] == 0).all()
        assert points.vertices(triangles).tolist() == np.unique([start, end]).tolist()
    corner = SurfacePoints.on_edges(start, start, np.zeros(len(start)), triangles)
    assert (corner.sample(vertices, triangles) == vertices[start]).all()


def brute_force(points, vertices, triangles, samples=40):
    """Nearest of many points sampled on the triangles: never nearer than the truth."""
    u, v = np.meshgrid(np.linspace(0, 1, samples), np.linspace(0, 1, samples))
    keep = u + v <= 1 + 1e-9
    weights = np.stack([1 - u - v, u, v], axis=-1)[keep]
    cloud = np.einsum("sk,tkd->tsd", weights, vertices[triangles]).reshape(-1, 3)
    return np.array([np.linalg.norm(cloud - p, axis=1).min() for p in points])


def test_nearest_point_is_exact_on_a_mesh_with_very_long_triangles():
    model = sheet_face(step_mm=12.0)
    vertices = model.neutral_mm.copy()
    vertices[vertices[:, 1] > 40, 1] += 400
    rng = np.random.default_rng(0)
    points = rng.uniform(-80, 80, (60, 3))
    found = Surface(vertices, model.triangles).closest(points)
    sampled = brute_force(points, vertices, model.triangles)
    assert (found.distance_mm <= sampled + 1e-9).all()
    assert (sampled - found.distance_mm).max() < 6.0  # the samples are up to 11 mm apart
    surface = Surface(vertices, model.triangles)
    everything = np.tile(np.arange(len(surface.corners)), (len(points), 1))
    exact, none = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    closest_of(
        points, np.zeros_like(points), none, np.arange(len(points)), everything, surface.corners, surface.normals,
        np.zeros(len(surface.corners), np.int64), -2.0, exact, none.copy(),
        np.zeros_like(points),
    )  # fmt: skip
    assert (found.distance_mm == exact).all()
    on = found.sample(vertices, model.triangles)
    assert np.abs(np.linalg.norm(points - on, axis=1) - found.distance_mm).max() < 1e-9


def test_no_point_where_no_triangle_faces_the_same_way():
    model = sheet_face()
    surface = Surface(model.neutral_mm, model.triangles)
    normals = vertex_normals(model.neutral_mm, model.triangles)
    assert surface.closest(model.neutral_mm, normals).bound.all()
    assert not surface.closest(model.neutral_mm, -normals).bound.any()
