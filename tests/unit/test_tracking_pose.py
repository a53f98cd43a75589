"""Rotations and the scaled orthographic pose."""

import numpy as np

from tests.unit.synthetic_face import landmark_layout
from vermilion.tracking.landmark_fit.pose import (
    left_jacobian,
    nearest_rotation,
    rotation_of,
    scaled_orthographic_pose,
    vector_of,
)


def test_vectors_and_rotations_are_inverse():
    vectors = np.random.default_rng(0).normal(size=(50, 3))
    rotations = rotation_of(vectors)
    assert np.allclose(rotations @ np.swapaxes(rotations, 1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(vector_of(rotations), vectors, atol=1e-9)
    assert np.allclose(rotation_of(np.zeros(3)), np.eye(3))


def test_left_jacobian_is_the_derivative():
    vector, step = np.array([0.4, -0.7, 0.2]), 1e-6 * np.array([1.0, 2.0, -1.0])
    small = vector_of(rotation_of(vector + step) @ rotation_of(vector).T)
    assert np.allclose(small, left_jacobian(vector) @ step, atol=1e-11)


def test_nearest_rotation_undoes_scale_and_is_proper():
    rotation = rotation_of(np.array([0.3, 0.2, -0.5]))
    assert np.allclose(nearest_rotation(2.5 * rotation), rotation, atol=1e-12)
    assert np.isclose(np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -0.1]))), 1)


def test_scaled_orthographic_pose_is_exact_on_scaled_orthographic_images():
    points = landmark_layout()
    wanted = rotation_of(np.array([0.1, 0.5, -0.2])) @ np.diag([1.0, -1.0, -1.0])
    image = 2.3 * points @ wanted[:2].T + [31.0, -12.0]
    rotation, scale, shift = scaled_orthographic_pose(points[None], image[None], np.ones((1, 66)))
    assert np.degrees(np.linalg.norm(vector_of(rotation[0] @ wanted.T))) < 0.01
    assert np.isclose(scale[0], 2.3, rtol=1e-4)
    assert np.allclose(shift[0], [31.0, -12.0], atol=0.01)
