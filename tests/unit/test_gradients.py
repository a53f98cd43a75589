"""Deformation gradients and their nine numbers, as maths."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vermilion.correction.gradients import (
    correction_gradients,
    deformation_gradients,
    triangle_frames,
)
from vermilion.correction.layers import (
    correction_layers,
    decode_layers,
    encode_gradients,
    polar_decomposition,
)
from vermilion.correction.rotations import rotation_matrix, rotation_vector

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


def test_no_difference_gives_the_zero_layer(vertices):
    np.testing.assert_allclose(
        correction_layers(vertices[None], vertices[None], TRIANGLES), 0.0, atol=1e-13
    )


def test_uniform_scale_is_recovered_in_all_directions(vertices):
    layers = correction_layers(vertices[None], 1.3 * vertices[None], TRIANGLES)[0]
    np.testing.assert_allclose(layers, [[0, 0, 0, 0.3, 0.3, 0.3, 0, 0, 0]] * 3, atol=1e-12)


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
    np.testing.assert_allclose(
        correction_gradients(coarse, accurate, vertices, accurate_neutral, TRIANGLES),
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
