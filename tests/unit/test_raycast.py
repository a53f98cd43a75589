"""Ray casting and sparse solves against closed forms."""

import numpy as np
from scipy import sparse

from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian

SQUARE = np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def camera():
    pose = look_at(np.array([0.0, 0, 400]), np.zeros(3), np.array([0, 1.0, 0]))
    return pinhole("c", 300, 80, 60, pose)


def test_hits_lie_where_their_pixels_say():
    hits = RayCaster(SQUARE, TWO).see(camera())
    points = interpolate(hits, TWO, SQUARE)
    seen = camera().project(points[hits.hit])
    assert np.abs(seen - camera().pixel_grid()[hits.hit]).max() < 1e-2


def test_what_lies_behind_is_hidden():
    wall = np.concatenate([SQUARE * [0.5, 0.5, 1] + [0, 0, 100], SQUARE])
    triangles = np.concatenate([TWO, TWO + 4])
    points = np.array([[0, 0, 100.0], [0, 0, 0.0], [45.0, 0, 0.0]])
    visible = RayCaster(wall, triangles).visible(camera(), points)
    assert visible.tolist() == [True, False, True]


def test_point_outside_the_image_is_not_visible():
    assert not RayCaster(SQUARE * 10, TWO).visible(camera(), np.array([[300.0, 0, 0]]))[0]


def test_factor_solves_many_sides():
    rng = np.random.default_rng(0)
    matrix = sparse.diags([np.full(99, -1.0), np.full(100, 3.0), np.full(99, -1.0)], [-1, 0, 1])
    right = rng.normal(size=(100, 2, 3))
    solution = CholeskyFactor(matrix).solve(right)
    back = (matrix @ solution.reshape(100, -1)).reshape(100, 2, 3)
    assert np.abs(back - right).max() < 1e-12


def test_laplacian_of_a_linear_function_vanishes_inside():
    n = 8
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = (k.ravel() for k in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    laplacian, mass = cotangent_laplacian(vertices, triangles)
    inside = ids[1:-1, 1:-1].ravel()
    assert np.abs((laplacian @ (2 * vertices[:, 0] - vertices[:, 1]))[inside]).max() < 1e-9
    assert np.isclose(mass.sum(), (n - 1) ** 2)
