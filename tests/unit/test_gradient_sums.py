"""Sums of deformation gradients by one sparse product, and normals that are prepared once."""

import numpy as np
from scipy import sparse

from tests import heads
from vermilion.geometry.deformation_gradients import deformation_gradients
from vermilion.geometry.gradient_sums import GradientSums, turned_by
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.vertex_normals import VertexNormals


def moved_face():
    face = heads.small_tracker()
    pose = face.vertices(None, np.full(face.n_expressions, 0.4))
    return face, pose + np.random.default_rng(0).normal(0, 0.2, pose.shape)


def test_a_sum_of_turned_vectors_is_that_of_the_gradients():
    face, pose = moved_face()
    rng, count = np.random.default_rng(1), len(face.triangles)
    triangle, vectors = rng.integers(0, count, 200), rng.normal(size=(200, 3))
    gather = sparse.random_array((50, 200), density=0.1, rng=rng)
    place = sparse.random_array((50, face.n_vertices), density=0.01, rng=rng)
    sums = GradientSums(
        face.neutral_mm, face.triangles, gather @ turned_by(triangle, vectors, count), place
    )
    gradients = deformation_gradients(face.neutral_mm, pose, face.triangles)
    turned = np.einsum("nij,nj->ni", gradients[triangle], vectors)
    np.testing.assert_allclose(sums.of(pose), gather @ turned + place @ pose, atol=1e-9)


def test_a_triangle_without_area_at_rest_turns_nothing():
    rest = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], dtype=float)
    triangles = np.array([[0, 1, 2], [0, 1, 3]])
    vectors = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]])
    sums = GradientSums(
        rest, triangles, turned_by(np.array([0, 1]), vectors, 2), sparse.csr_array((2, 4))
    )
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], dtype=float)
    np.testing.assert_allclose(sums.of(rest @ quarter.T), [[1, 2, 3], [-2, 1, 3]], atol=1e-12)


def test_prepared_normals_are_those_of_the_mesh():
    face, pose = moved_face()
    prepared = VertexNormals(face.triangles, face.n_vertices)
    for vertices in (face.neutral_mm, pose):
        np.testing.assert_allclose(
            prepared.of(vertices), vertex_normals(vertices, face.triangles), atol=1e-12
        )
