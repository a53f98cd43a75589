"""Cross-validation over clips as maths: equal to fitting and predicting, whoever is left out."""

import numpy as np
import pytest

from tests.unit.regression_data import smooth_data
from vermilion.regression.cross_validation import (
    clips_of_rows,
    cross_validate,
    folds_of,
    target_gram,
)
from vermilion.regression.estimators import AffineRegressor, RBFNetwork, temporal_prototypes
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.linear import unseen_subject_bias


def group_folds(n_folds, clips):
    # Where it is needed: every process of the tests imports this file, one of them runs it.
    from sklearn.model_selection import GroupKFold

    return GroupKFold(n_folds).split(clips, groups=clips)


@pytest.fixture
def data():
    return smooth_data()


def test_prototypes_are_every_tenth_frame_of_each_sequence():
    sequences = np.repeat([4, 9], [50, 30])
    np.testing.assert_array_equal(
        temporal_prototypes(sequences, 10), [5, 15, 25, 35, 45, 55, 65, 75]
    )


def test_short_takes_get_more_prototypes():
    assert len(temporal_prototypes(np.zeros(34), 10, minimum=20)) == 34
    assert len(temporal_prototypes(np.zeros(45), 10, minimum=20)) == 22
    assert len(temporal_prototypes(np.repeat([0, 1], [30, 2]), 10)) == 4  # 3 and the middle of 2


def test_clips_are_contiguous_and_never_cross_sequences():
    sequences = np.repeat([0, 1], [70, 31])
    clips = clips_of_rows(sequences, 30, 3)
    assert np.all(np.diff(clips) >= 0)
    assert not set(clips[:70]) & set(clips[70:])
    assert len(np.unique(clips_of_rows(np.zeros(9), 30, 5))) >= 5


@pytest.mark.parametrize("n_folds", [2, 5, 40])
def test_folds_are_those_of_group_k_fold(n_folds):
    clips = np.random.default_rng(3).integers(0, 17, 200)
    ours = folds_of(clips, n_folds)
    theirs = group_folds(min(n_folds, 17), clips)
    for fold, (train, held) in zip(ours, theirs, strict=True):
        assert np.array_equal(fold[0], train)
        assert np.array_equal(fold[1], held)


def test_cross_validation_equals_fitting_and_predicting(data):
    features, targets = data
    sequences, weights = np.repeat([0, 1], 60), np.linspace(0.5, 2.0, 30)
    clips = clips_of_rows(sequences, 15, 5)
    alphas, betas = [1e-4, 1e-2, 10.0], [0.1, 3.0]
    groups = ["a"] * 3 + ["b"] * 4
    given = (features, target_gram(targets, weights), sequences, clips)
    network = RBFNetwork(feature_groups=groups, reach=0.1)
    curve = cross_validate(network, *given, alphas=alphas, betas=betas)
    affine = cross_validate(AffineRegressor(), *given, alphas=alphas)
    kernel = cross_validate(KernelRegressor(), *given, alphas=alphas, betas=betas)
    for k, (train, held) in enumerate(group_folds(5, clips)):

        def error(regressor, train=train, held=held):
            fitted = regressor.fit(features[train], targets[train], sequences[train])
            squares = (fitted.predict(features[held]) - targets[held]) ** 2
            return np.sqrt((squares @ weights).sum() / (len(held) * weights.sum()))

        for j, alpha in enumerate(alphas):
            for i, beta in enumerate(betas):
                network = RBFNetwork(alpha, beta, feature_groups=groups, reach=0.1)
                plain = error(network)
                assert curve.errors[i, j, k] == pytest.approx(plain, rel=1e-5)
                plain = error(KernelRegressor(alpha, beta))
                assert kernel.errors[i, j, k] == pytest.approx(plain, rel=1e-5)
            assert affine.errors[0, j, k] == pytest.approx(error(AffineRegressor(alpha)), rel=1e-5)


def test_cross_validation_with_a_bias_a_person_equals_fitting_and_predicting(data):
    features, targets = data
    persons = np.repeat([0, 1, 2], [50, 60, 10])
    targets = targets + 5.0 * persons[:, None]
    clips = clips_of_rows(persons, 10, 4)
    curve = cross_validate(
        AffineRegressor(), features, target_gram(targets), persons, clips,
        alphas=[0.1], n_folds=4, persons=persons,
    )  # fmt: skip
    for k, (train, held) in enumerate(group_folds(4, clips)):
        people, label = np.unique(persons[train], return_inverse=True)
        regressor = AffineRegressor(0.1).fit(features[train], targets[train], persons=label)
        squares = []
        for person in np.unique(persons[held]):
            rows = held[persons[held] == person]
            if person in people:
                predicted = regressor.predict(features[rows], int(np.searchsorted(people, person)))
                squares.append((predicted - targets[rows]) ** 2)
        if set(persons[held]) <= set(people):
            plain = np.sqrt(np.concatenate(squares).mean())
            assert curve.errors[0, 0, k] == pytest.approx(plain, rel=1e-5)


def test_a_bias_a_person_takes_what_no_feature_tells(data):
    features, targets = data
    persons = np.repeat([0, 1], 60)
    shifted = targets + np.where(persons == 0, -2.0, 3.0)[:, None]
    plain = AffineRegressor(1.0).fit(features, targets, persons=persons)
    own = AffineRegressor(1.0).fit(features, shifted, persons=persons)
    np.testing.assert_allclose(
        own.coefficients_ @ own.basis_, plain.coefficients_ @ plain.basis_, atol=1e-9
    )
    for person, shift in ((0, -2.0), (1, 3.0)):
        np.testing.assert_allclose(
            own.predict(features, person), plain.predict(features, person) + shift, atol=1e-9
        )


def test_an_unseen_subject_gets_the_mean_identity_drawn_towards_none():
    neutral = np.zeros(400)
    rng = np.random.default_rng(0)
    alike = 1.0 + 0.01 * rng.normal(size=(4, 400))
    np.testing.assert_allclose(unseen_subject_bias(alike, neutral), 1.0, atol=0.03)
    unlike = rng.normal(size=(4, 400))
    assert np.abs(unseen_subject_bias(unlike, neutral)).mean() < 0.1
    np.testing.assert_array_equal(unseen_subject_bias(alike[:1], neutral), 0.0)


def test_what_people_share_in_layers_is_kept_though_their_displacements_differ():
    """An unseen subject's place is not guessed from people who lie now here, now there."""
    rng = np.random.default_rng(3)
    persons, features = np.repeat(np.arange(4), 30), rng.normal(size=(120, 5))
    features[::30] = 0.0
    layers = np.ones((120, 50)) + 0.01 * rng.normal(size=(120, 50))
    places = 3.0 * rng.normal(size=(4, 80))[persons]
    targets = np.concatenate([layers, places], axis=1)
    apart = AffineRegressor(10.0).fit(features, targets, persons=persons, n_layers=50)
    neutral = apart.predict(np.zeros((1, 5)))[0]
    np.testing.assert_allclose(neutral[:50], 1.0, atol=0.05)
    assert np.abs(neutral[50:]).mean() < 0.5
    together = AffineRegressor(10.0).fit(features, targets, persons=persons)
    assert np.abs(together.predict(np.zeros((1, 5)))[0][:50] - 1.0).mean() > 0.1


def test_an_unseen_subject_gets_no_identity_of_the_only_person_known():
    """Their expressions are moved alike, their neutral is not."""
    rng = np.random.default_rng(4)
    features, persons = rng.normal(size=(60, 5)), np.zeros(60, dtype=int)
    features[0] = 0.0
    matrix = rng.normal(size=(5, 8))
    known = AffineRegressor(1e-6).fit(features, features @ matrix + 2.0, persons=persons)
    asked = rng.normal(size=(3, 5))
    np.testing.assert_allclose(known.predict(asked, 0), asked @ matrix + 2.0, atol=1e-3)
    np.testing.assert_allclose(known.predict(asked), asked @ matrix, atol=1e-3)


def test_choice_takes_the_smoothest_within_one_standard_error(data):
    features, targets = data
    clips = clips_of_rows(np.zeros(120), 15, 5)
    curve = cross_validate(
        AffineRegressor(), features, target_gram(targets), np.zeros(120), clips,
        alphas=[1e-3, 1e-2, 1e-1, 1.0, 1e3],
    )  # fmt: skip
    least, simplest = curve.choose("least"), curve.choose("simplest")
    assert curve.mean[least] == curve.mean.min()
    assert curve.freedom[simplest] <= curve.freedom[least]
    assert curve.mean[simplest] <= curve.mean[least] + curve.standard_error[least]
    # Freedom falls as alpha grows, from the number of features to none.
    assert np.all(np.diff(curve.freedom[0]) < 0)
    assert curve.freedom[0, 0] < 7
