"""Rotations and rotation vectors."""

import numpy as np

from vermilion.geometry.rotations import (
    cross_matrix,
    exp_about_mean,
    left_jacobian,
    log_about_mean,
    mean_rotation,
    nearest_rotation,
    rotation_matrix,
    rotation_vector,
)


def test_vectors_and_rotations_are_inverse():
    vectors = np.random.default_rng(0).normal(size=(50, 3))
    rotations = rotation_matrix(vectors)
    assert np.allclose(rotations @ np.swapaxes(rotations, 1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(rotation_vector(rotations), vectors, atol=1e-9)
    assert np.allclose(rotation_matrix(np.zeros(3)), np.eye(3))


def test_left_jacobian_is_the_derivative():
    vector, step = np.array([0.4, -0.7, 0.2]), 1e-6 * np.array([1.0, 2.0, -1.0])
    small = rotation_vector(rotation_matrix(vector + step) @ rotation_matrix(vector).T)
    assert np.allclose(small, left_jacobian(vector) @ step, atol=1e-11)


def test_nearest_rotation_undoes_scale_and_is_proper():
    rotation = rotation_matrix(np.array([0.3, 0.2, -0.5]))
    assert np.allclose(nearest_rotation(2.5 * rotation), rotation, atol=1e-12)
    assert np.isclose(np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -0.1]))), 1)


def test_the_cross_matrix_is_the_cross_product():
    a, b = np.random.default_rng(1).normal(size=(2, 20, 3))
    assert np.allclose((cross_matrix(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)


def test_logarithms_about_the_mean_are_inverse_and_balanced():
    """Small turns about a common axis cancel: their mean is the axis' rotation itself."""
    common = rotation_matrix(np.array([2.9, 0.4, -0.1]))
    turns = rotation_matrix(np.array([[0.1, 0, 0], [-0.1, 0, 0], [0, 0.2, 0], [0, -0.2, 0]]))
    vectors, mean = log_about_mean(turns @ common)
    assert np.allclose(mean, common, atol=1e-12)
    assert np.allclose(vectors.sum(axis=0), 0.0, atol=1e-12)
    assert np.allclose(exp_about_mean(vectors, mean), turns @ common, atol=1e-14)
    assert np.allclose(mean_rotation(common[None]), common, atol=1e-14)
