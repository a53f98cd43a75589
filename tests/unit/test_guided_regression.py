"""Reduced regression, integration, regions: identities of Guided18 section 4."""

import numpy as np
import pytest

from tests.unit import guided_mouths as mouths
from vermilion.geometry.deformation_gradients import deformation_gradients
from vermilion.guided.dirichlet import GradientIntegrator
from vermilion.guided.gradients import NeutralTriangles
from vermilion.guided.reduced_regression import ReducedRegression, reduced_basis
from vermilion.guided.regions import (
    GuidedRegions,
    movable_vertices,
    regions_of_face,
    regions_of_vertices,
)
from vermilion.storage.errors import InputError, ModelFileError

RNG_SEED = 3


def training(k=6, m=20, n=9, seed=RNG_SEED):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(k, 9 * m)) + 1.0, rng.normal(size=(k, 9 * n))


def test_it_is_the_minimum_norm_solution_of_the_full_system():
    trusted, predicted = training()
    full = predicted.T @ np.linalg.pinv(trusted.T)  # theta (9n, 9m) of least Frobenius norm
    unseen = np.random.default_rng(9).normal(size=(4, trusted.shape[1]))
    regression = ReducedRegression().fit(trusted, predicted)
    np.testing.assert_allclose(regression.predict(unseen), unseen @ full.T, atol=1e-11)


def test_it_satisfies_the_normal_equations_of_the_paper():
    trusted, predicted = training()
    fitted = ReducedRegression().fit(trusted, predicted)
    theta = fitted.predicted_basis_.T @ fitted.reduced_ @ fitted.trusted_basis_
    np.testing.assert_allclose(theta @ trusted.T @ trusted, predicted.T @ trusted, atol=1e-9)


def test_a_training_frame_is_reproduced_exactly():
    trusted, predicted = training(k=11)
    regression = ReducedRegression().fit(trusted, predicted)
    np.testing.assert_allclose(regression.predict(trusted), predicted, atol=1e-11)
    assert regression.unexplained(trusted, np.zeros(trusted.shape[1])).max() < 1e-6


def test_frames_that_are_nearly_alike_are_reproduced_as_well():
    trusted, predicted = training()
    near = trusted[:1] + 1e-4 * np.random.default_rng(1).normal(size=trusted[:1].shape)
    trusted, predicted = (
        np.concatenate([trusted, near]),
        np.concatenate([predicted, predicted[:1] + 0.1]),
    )
    regression = ReducedRegression().fit(trusted, predicted)
    np.testing.assert_allclose(regression.predict(trusted), predicted, atol=1e-7)


def test_a_frame_that_is_given_twice_changes_nothing():
    trusted, predicted = training()
    once = ReducedRegression().fit(trusted, predicted)
    twice = ReducedRegression().fit(
        np.concatenate([trusted, trusted[:2]]), np.concatenate([predicted, predicted[:2]])
    )
    np.testing.assert_allclose(once.predict(trusted * 0.9), twice.predict(trusted * 0.9), atol=1e-9)
    assert twice.trusted_basis_.shape == once.trusted_basis_.shape


def test_the_basis_is_the_singular_value_decomposition():
    columns, _ = training(k=5)
    basis = reduced_basis(columns)
    singular = np.linalg.svd(columns, compute_uv=False)
    np.testing.assert_allclose(basis.directions @ basis.directions.T, np.eye(5), atol=1e-9)
    np.testing.assert_allclose(basis.coefficients.T @ basis.directions, columns, atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(basis.coefficients, axis=1), singular, rtol=1e-10)


def test_lips_that_need_no_correction_are_predicted_so():
    trusted, predicted = training()
    found = ReducedRegression().fit(trusted, np.zeros_like(predicted)).predict(trusted + 0.3)
    np.testing.assert_array_equal(found, np.zeros_like(predicted))


@pytest.mark.parametrize(
    ("trusted", "predicted", "message"),
    [
        (np.zeros((0, 9)), np.zeros((0, 9)), "no corrected frame"),
        (np.zeros((2, 9)), np.zeros((3, 9)), "same k frames"),
        (np.full((2, 9), np.nan), np.zeros((2, 9)), r"rows \[0, 1\]"),
    ],
)
def test_training_data_that_cannot_serve_are_named(trusted, predicted, message):
    with pytest.raises(InputError, match=message):
        ReducedRegression().fit(trusted, predicted)


def test_gradients_of_another_region_are_refused():
    regression = ReducedRegression().fit(*training())
    with pytest.raises(InputError, match=r"\(frames, 180\)"):
        regression.predict(np.zeros((1, 90)))


def test_a_newer_regression_is_refused():
    arrays = ReducedRegression().fit(*training()).arrays()
    with pytest.raises(ModelFileError, match="format 2"):
        ReducedRegression.from_arrays(arrays | {"regression_version": np.int64(2)})
    with pytest.raises(ModelFileError, match="no reduced"):
        ReducedRegression.from_arrays({k: v for k, v in arrays.items() if k != "reduced"})


def test_gradients_are_those_of_the_correction_layer():
    face, take = mouths.small_face(), mouths.small_take(3)
    chosen = face.triangles[mouths.small_regions().trusted]
    expected = deformation_gradients(face.neutral_mm, take, chosen).reshape(3, -1)
    found = NeutralTriangles(face.neutral_mm, chosen).gradients(take)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_triangle_without_area_has_the_identity():
    neutral = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    gradients = NeutralTriangles(neutral, np.array([[0, 1, 2]])).gradients(neutral[None] + 1.0)
    np.testing.assert_array_equal(gradients, np.eye(3).reshape(1, 9))


def test_true_gradients_give_the_true_mesh():
    face, regions, take = mouths.small_face(), mouths.small_regions(), mouths.small_take(4)
    triangles = face.triangles[regions.predicted]
    true = NeutralTriangles(face.neutral_mm, triangles).gradients(take)
    spoilt = take.copy()
    spoilt[:, regions.free] += 5.0
    found = GradientIntegrator(face.neutral_mm, regions).integrate(true, spoilt)
    inner = regions.inner_vertices
    assert np.abs(found[:, inner] - take[:, inner]).max() < 1e-6


def test_the_border_and_the_rest_of_the_face_stay_exactly():
    face, regions, take = mouths.small_face(), mouths.small_regions(), mouths.small_take(2)
    identity = np.tile(np.eye(3).ravel(), (2, len(regions.predicted)))
    found = GradientIntegrator(face.neutral_mm, regions).integrate(identity, take)
    others = np.setdiff1d(
        np.arange(face.n_vertices), np.concatenate([regions.free, regions.followers])
    )
    assert np.isin(regions.border, others).all()
    assert np.abs(found[:, others] - take[:, others]).max() < 1e-9
    assert np.abs(found[:, regions.free] - take[:, regions.free]).max() > 0.1


def test_the_mesh_has_no_tear_between_border_and_lips():
    """A smooth change of the gradients moves the vertices next to the border little."""
    face, regions = mouths.small_face(), mouths.small_regions()
    neutral = face.neutral_mm[None]
    stretched = np.tile((1.02 * np.eye(3)).ravel(), (1, len(regions.predicted)))
    found = GradientIntegrator(face.neutral_mm, regions).integrate(stretched, neutral)
    assert np.abs(found - neutral).max() < 0.02 * 60  # 2 % of a mouth 60 mm wide


def test_what_hangs_on_the_lips_goes_along_and_stays_far_inside():
    face, regions = mouths.small_face(), mouths.small_regions()
    moved = face.neutral_mm[None].copy()
    moved[:, regions.inner_vertices] += [0.0, 0.0, 3.0]
    found = GradientIntegrator(face.neutral_mm, regions).follow(moved, face.neutral_mm[None])[0]
    shift = (found - face.neutral_mm)[regions.followers]
    distance = np.linalg.norm(
        face.neutral_mm[regions.followers][:, None] - face.neutral_mm[regions.free], axis=2
    ).min(axis=1)
    assert shift[distance < 3.0, 2].mean() > 1.5
    assert np.abs(shift[distance > 40.0]).max() < 0.3


def test_regions_are_apart_and_the_border_lies_on_both():
    face, regions = mouths.face(), mouths.regions()
    assert len(np.intersect1d(regions.predicted, regions.trusted)) == 0
    trusted = np.unique(face.triangles[regions.trusted])
    assert np.isin(regions.border, trusted).all()
    assert not np.isin(regions.free, trusted).any()
    assert not face.regions["face"][regions.followers].any()


def test_a_larger_inner_size_predicts_more_and_trusts_less():
    small, large = (regions_of_face(mouths.face(), inner_mm=size) for size in (3.0, 8.0))
    assert np.isin(small.predicted, large.predicted).all()
    assert len(large.predicted) > len(small.predicted)
    assert len(large.trusted) < len(small.trusted)


def test_vertex_lists_give_the_regions_of_any_topology():
    triangles, n = grid(9)
    ids = np.arange(n).reshape(9, 9)
    regions = regions_of_vertices(triangles, n, ids[3:6, 3:6].ravel(), ids[1:8, 1:8].ravel())
    assert len(regions.predicted) == 8
    np.testing.assert_array_equal(regions.free, [ids[4, 4]])
    assert len(regions.border) == 8
    assert len(regions.followers) == 0
    rim = np.setdiff1d(ids[1:8, 1:8], movable_vertices(regions))
    np.testing.assert_array_equal(rim, np.setdiff1d(ids[1:8, 1:8], ids[2:7, 2:7]))


def test_restricted_regions_are_the_same_triangles():
    regions = mouths.small_regions()
    kept = regions.mouth_vertices
    local = regions.restricted(kept)
    for name in ("predicted", "trusted"):
        there = kept[local.triangles[getattr(local, name)]]
        np.testing.assert_array_equal(there, regions.triangles[getattr(regions, name)])
    for name in ("border", "free", "followers"):
        np.testing.assert_array_equal(kept[getattr(local, name)], getattr(regions, name))


def test_regions_survive_their_arrays():
    regions = mouths.small_regions()
    again = GuidedRegions.from_arrays(regions.arrays())
    for name in ("predicted", "trusted", "border", "free", "followers"):
        np.testing.assert_array_equal(getattr(again, name), getattr(regions, name))


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ([], "no triangle in the inner lips"),
        ([0, 1, 900], "numbers from 0 to 80"),
        ([0.5, 1.0], "whole numbers"),
        (np.arange(81), "no triangle in the mouth region"),
    ],
)
def test_vertex_lists_that_cannot_serve_are_named(inner, message):
    triangles, n = grid(9)
    with pytest.raises(InputError, match=message):
        regions_of_vertices(triangles, n, np.array(inner), np.arange(n))


def grid(n: int) -> tuple[np.ndarray, int]:
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i in (0, 1) for j in (0, 1))
    return np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)]), n * n
