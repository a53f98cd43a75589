"""Deformation gradients and their nine numbers, as maths."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vermilion.correction.layers import (
    correction_layers,
    decode_layers,
    encode_gradients,
    polar_decomposition,
)
from vermilion.correction.take_layers import displacements, take_layers
from vermilion.geometry.deformation_gradients import (
    deformation_gradients,
    inverse_3x3,
    triangle_frames,
)
from vermilion.geometry.head_frame import world_from_head
from vermilion.geometry.rotations import rotation_matrix, rotation_vector

TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]])


@pytest.fixture
def vertices():
    return np.random.default_rng(3).normal(scale=20.0, size=(5, 3))


def test_phantom_vertex_lies_along_the_normal_at_the_root_of_twice_the_area():
    corners = np.array([[0.0, 0, 0], [4, 0, 0], [0, 9, 0]])
    frame = triangle_frames(corners, np.array([[0, 1, 2]]))[0]
    np.testing.assert_allclose(frame, [[4, 0, 0], [0, 9, 0], [0, 0, 6]], atol=1e-12)


def test_rigid_motion_gives_rotation_alone(vertices):
    rotation = Rotation.from_rotvec([0.4, -1.1, 0.3]).as_matrix()
    moved = vertices @ rotation.T + [5.0, -3.0, 100.0]
    gradients = deformation_gradients(vertices, moved, TRIANGLES)
    np.testing.assert_allclose(gradients, np.broadcast_to(rotation, gradients.shape), atol=1e-12)
    layers = encode_gradients(gradients)
    np.testing.assert_allclose(layers[:, 3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(layers[:, :3], [[0.4, -1.1, 0.3]] * 3, atol=1e-12)


@pytest.mark.parametrize("region", ["rigid", "face"])
@pytest.mark.parametrize("head", ["frame", "neutral"])
def test_rigid_motion_of_the_head_gives_the_zero_layer(head, region):
    """H is C seen by another tracker: each frame of either has a rigid motion of its own."""
    n_frames, n_vertices = 4, 8
    rng = np.random.default_rng(11)
    triangles = np.array([*TRIANGLES, [0, 3, 5], [5, 6, 7]])
    vertices = rng.normal(scale=20.0, size=(n_vertices, 3))
    rotation = Rotation.from_rotvec(rng.normal(scale=0.8, size=(n_frames, 3))).as_matrix()
    translation = rng.normal(scale=200.0, size=(n_frames, 3))
    shape = np.tile(vertices, (n_frames, 1, 1))
    shape[1:, 4] += rng.normal(scale=4.0, size=(n_frames - 1, 3))  # the only part that moves
    coarse = world_from_head(shape, rotation, translation)
    other = Rotation.from_rotvec(rng.normal(size=(n_frames, 3))).as_matrix()
    accurate = coarse @ np.swapaxes(other, 1, 2) + rng.normal(scale=90.0, size=(n_frames, 1, 3))
    correspondence = SimpleNamespace(
        on_coarse=lambda meshes: meshes,
        rigid=np.isin(np.arange(n_vertices), [0, 3, 6, 7]),
        coarse_triangles=triangles,
        coarse_neutral_mm=vertices,
        mask=np.array([2]),
        vertices=SimpleNamespace(bound=np.ones(n_vertices, dtype=bool)),
    )
    made = take_layers(
        correspondence, accurate, coarse, rotation, translation,
        accurate_neutral_mm=accurate[0] if head == "neutral" else None,
        face=np.ones(n_vertices, dtype=bool) if region == "face" else None,
    )  # fmt: skip
    assert made.valid.all()
    np.testing.assert_allclose(made.layers, 0.0, atol=1e-9)
    np.testing.assert_allclose(displacements(made, np.arange(n_vertices)), 0.0, atol=1e-4)  # mm


def test_no_difference_gives_the_zero_layer(vertices):
    np.testing.assert_allclose(
        correction_layers(vertices[None], vertices[None], TRIANGLES), 0.0, atol=1e-13
    )


def test_uniform_scale_is_recovered_in_all_directions(vertices):
    layers = correction_layers(vertices[None], 1.3 * vertices[None], TRIANGLES)[0]
    np.testing.assert_allclose(layers, [[0, 0, 0, 0.3, 0.3, 0.3, 0, 0, 0]] * 3, atol=1e-12)


def test_known_affine_map_is_recovered_exactly():
    """In all nine entries, where it takes the normal of a plane as the phantom vertex goes: by the
    root of the area's growth."""
    plane = Rotation.from_rotvec([0.7, -0.2, 1.9]).as_matrix()
    tangential = np.array([[1.4, 0.3], [-0.5, 0.8]])
    local = np.eye(3)
    local[:2, :2] = tangential
    local[2, 2] = np.sqrt(np.linalg.det(tangential))
    affine = Rotation.from_rotvec([-2.1, 0.4, 0.3]).as_matrix() @ plane @ local @ plane.T
    flat = np.random.default_rng(5).normal(scale=20.0, size=(5, 3)) * [1, 1, 0]
    vertices = flat @ plane.T + [4.0, 5.0, 6.0]
    gradients = deformation_gradients(vertices, vertices @ affine.T + 7.0, TRIANGLES)
    np.testing.assert_allclose(gradients, [affine] * 3, atol=1e-12)
    np.testing.assert_allclose(decode_layers(encode_gradients(gradients)), [affine] * 3, atol=1e-12)


def test_affine_map_acts_on_the_triangles_edges(vertices):
    affine = np.array([[1.2, 0.1, 0.0], [-0.2, 0.9, 0.3], [0.1, 0.0, 1.1]])
    gradients = deformation_gradients(vertices, vertices @ affine.T, TRIANGLES)
    for gradient, triangle in zip(gradients, TRIANGLES, strict=True):
        edges = (vertices[triangle[1:]] - vertices[triangle[0]]).T
        np.testing.assert_allclose(gradient @ edges, affine @ edges, atol=1e-11)


def test_equation_1_with_one_topology_is_the_gradient_from_coarse_to_accurate(vertices):
    rng = np.random.default_rng(8)
    coarse, accurate, accurate_neutral = (
        vertices + rng.normal(scale=3.0, size=vertices.shape) for _ in range(3)
    )
    expression_h = deformation_gradients(accurate_neutral, accurate, TRIANGLES)
    identity = deformation_gradients(vertices, accurate_neutral, TRIANGLES)
    expression_c = deformation_gradients(vertices, coarse, TRIANGLES)
    np.testing.assert_allclose(
        expression_h @ identity @ inverse_3x3(expression_c),  # H_f D_0 C_f^-1
        deformation_gradients(coarse, accurate, TRIANGLES),
        atol=1e-9,
    )


def test_triangle_without_area_gets_the_identity():
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    target = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    gradient = deformation_gradients(flat, target, np.array([[0, 1, 2]]))[0]
    np.testing.assert_array_equal(gradient, np.eye(3))


@pytest.mark.parametrize("spread", [1e-9, 0.1, 0.5, 3.0])
def test_nine_numbers_round_trip(spread):
    gradients = np.eye(3) + spread * np.random.default_rng(1).normal(size=(5000, 3, 3))
    np.testing.assert_allclose(
        decode_layers(encode_gradients(gradients)), gradients, atol=1e-9, rtol=1e-9
    )


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4, 1.0, np.pi - 1e-4, np.pi - 1e-9, np.pi])
def test_nine_numbers_round_trip_at_small_turns_and_near_half_a_turn(angle):
    rng = np.random.default_rng(7)
    axes = rng.normal(size=(500, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    roots = np.eye(3) + 0.3 * rng.normal(size=(500, 3, 3))
    stretches = roots @ np.swapaxes(roots, 1, 2)
    gradients = Rotation.from_rotvec(angle * axes).as_matrix() @ stretches
    np.testing.assert_allclose(
        decode_layers(encode_gradients(gradients)), gradients, atol=1e-9, rtol=1e-9
    )


def test_round_trip_of_singular_and_inverted_gradients():
    gradients = np.stack(
        [np.diag([1.0, 1, 0]), np.diag([1.0, 1, -0.5]), np.zeros((3, 3)), -np.eye(3)]
    )
    np.testing.assert_allclose(decode_layers(encode_gradients(gradients)), gradients, atol=1e-12)


def test_polar_decomposition_gives_rotation_and_symmetric_stretch():
    gradients = np.eye(3) + 0.6 * np.random.default_rng(2).normal(size=(3000, 3, 3))
    rotations, stretches = polar_decomposition(gradients)
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, 1, 2), [np.eye(3)] * 3000, atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=1e-12)
    np.testing.assert_array_equal(stretches, np.swapaxes(stretches, 1, 2))
    np.testing.assert_allclose(rotations @ stretches, gradients, atol=1e-12)


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_rotation_logarithm_near_half_a_turn(gap):
    axes = np.random.default_rng(4).normal(size=(500, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    rotations = Rotation.from_rotvec(axes * (np.pi - gap)).as_matrix()
    vectors = rotation_vector(rotations)
    np.testing.assert_allclose(rotation_matrix(vectors), rotations, atol=1e-12)
    # At half a turn either axis is right.
    error = np.minimum(
        np.linalg.norm(vectors - axes * (np.pi - gap), axis=1),
        np.linalg.norm(vectors + axes * (np.pi - gap), axis=1) if gap < 1e-8 else np.inf,
    )
    assert error.max() < 1e-7


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 1e-3])
def test_rotation_logarithm_keeps_its_digits_at_small_angles(angle):
    vector = angle * np.array([[0.6, 0.0, -0.8]])
    np.testing.assert_allclose(
        rotation_vector(rotation_matrix(vector)), vector, rtol=1e-12, atol=1e-320
    )


def test_layers_of_another_length_are_refused():
    with pytest.raises(ValueError, match=r"\(\.\.\., 9\), got \(4, 8\)"):
        decode_layers(np.zeros((4, 8)))
