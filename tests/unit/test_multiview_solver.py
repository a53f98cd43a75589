"""The deformation solve against dense algebra, and its prior against rigid motion."""

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.multiview.solver import DisplacementSolver, ThinPlate, solve_displacement


def bump(n=21, size_mm=40.0):
    """A sheet with a bump."""
    line = np.linspace(-size_mm / 2, size_mm / 2, n)
    x, y = (a.reshape(-1) for a in np.meshgrid(line, line))
    z = 8 * np.exp(-(x**2 + y**2) / 100)
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = (k.ravel() for k in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, z], axis=1), triangles


def test_conjugate_gradients_solve_the_coupled_system():
    vertices, triangles = bump(9)
    plate = ThinPlate.of(vertices, triangles)
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(len(vertices), 2, 3))
    blocks, right = np.einsum("vki,vkj->vij", rows, rows), rng.normal(size=vertices.shape)
    solver = DisplacementSolver(plate, blocks, 3.0, tolerance=1e-10, max_iterations=2000)
    found = solver.solve(blocks, right)
    n = len(vertices)
    dense = np.kron(plate.bending.toarray() * 3.0**4, np.eye(3))
    for i in range(n):
        block = plate.areas_mm2[i] * (blocks[i] + solver.anchor * np.eye(3))
        dense[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += block
    exact = np.linalg.solve(dense, (plate.areas_mm2[:, None] * right).reshape(-1))
    assert np.abs(found.reshape(-1) - exact).max() < 1e-6 * np.abs(exact).max()


def test_a_translation_seen_at_some_vertices_carries_the_others():
    vertices, triangles = bump()
    plate = ThinPlate.of(vertices, triangles)
    known = np.random.default_rng(0).random(len(vertices)) < 0.1
    blocks = known[:, None, None] * np.eye(3)
    moved = solve_displacement(plate, blocks, known[:, None] * np.array([1.0, -2.0, 0.5]), 5.0)
    assert np.abs(moved - [1.0, -2.0, 0.5]).max() < 1e-2


def test_a_turned_rest_shape_lacks_nothing():
    vertices, triangles = bump()
    plate = ThinPlate.of(vertices, triangles)
    turn = Rotation.from_euler("xyz", [30, -20, 10], degrees=True).as_matrix()
    turned = vertices @ turn.T + [5, 6, 7]
    assert np.abs(plate.rotations(turned) - turn).max() < 1e-9
    assert np.abs(plate.missing(turned)).max() < 1e-9
    assert np.abs(plate.missing(vertices * [1, 1, 0.5])).max() > 0.1


def test_hidden_vertices_turn_with_what_is_seen_round_them():
    vertices, triangles = bump()
    plate = ThinPlate.of(vertices, triangles)
    turn = Rotation.from_euler("x", 25, degrees=True).as_matrix()
    truth = vertices @ turn.T
    seen = np.linalg.norm(vertices[:, :2], axis=1) > 8
    current = vertices.copy()
    blocks = seen[:, None, None] * np.eye(3)
    for _ in range(5):
        right = seen[:, None] * (truth - current)
        current += solve_displacement(plate, blocks, right, 2.0, plate.missing(current))
    assert np.linalg.norm(current - truth, axis=1).max() < 0.15  # mm; a smooth fill is 0.7 mm off
    assert np.linalg.norm((current - truth)[seen], axis=1).max() < 0.05


def test_stiffness_is_a_length_whatever_the_resolution():
    for n in (31, 61):
        vertices, triangles = bump(n, 60.0)
        vertices[:, 2] = 0
        plate = ThinPlate.of(vertices, triangles)
        wave_mm = 20.0
        data = np.zeros_like(vertices)
        data[:, 2] = np.sin(2 * np.pi * vertices[:, 0] / wave_mm)
        blocks = np.tile(np.eye(3), (len(vertices), 1, 1))
        found = solve_displacement(plate, blocks, data, 3.0)
        inside = np.abs(vertices[:, :2]).max(axis=1) < 15
        share = (found[inside, 2] @ data[inside, 2]) / (data[inside, 2] @ data[inside, 2])
        theory = 1 / (1 + (3.0 * 2 * np.pi / wave_mm) ** 4)
        assert abs(share - theory) < 0.04
