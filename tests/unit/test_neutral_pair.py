"""A person, and a take, made known to a regressor by pairs of neutrals."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vermilion.correction.correct import CorrectionSettings, Corrector
from vermilion.correction.layers import correction_layers
from vermilion.correction.neutral_pair import NeutralPair, with_known_neutrals
from vermilion.geometry.mesh import topology_hash
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.model import LipModel
from vermilion.storage.errors import InputError

TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]])
MASK = np.array([1, 2])
VERTICES = np.array([1, 2, 3, 4])
NAMES = ("shape_01", "shape_02", "outer_width", "lower_lip_1")


def shape(seed):
    return np.random.default_rng(seed).normal(scale=30.0, size=(6, 3))


@pytest.fixture
def model():
    """Of two people, each with a bias."""
    rng = np.random.default_rng(0)
    features, targets = rng.normal(size=(60, 3)), rng.normal(size=(60, 30)).astype(np.float32)
    persons = np.repeat([0, 1], 30)
    return LipModel(
        name="GR-eva",
        estimator=KernelRegressor(0.1, 0.3).fit(
            features, targets, persons, persons=persons, n_layers=18
        ),
        feature_names=NAMES,
        feature_columns=np.array([0, 2, 3]),
        mask=MASK,
        topology=topology_hash(TRIANGLES),
        training_frames={"zoe/rom": np.arange(30), "ana/rom": np.arange(30)},
        vertices=VERTICES,
        neutrals_mm={"zoe": shape(1), "ana": shape(2)},
        shifts=np.array([[0.3, 0.0, -0.2, 0.1], [-0.3, 0.0, 0.2, -0.1]]),
        neutral_features=np.array([0.1, 0.2, 0.3, 0.4]),
    )


@pytest.fixture
def pair():
    coarse = shape(3)
    return NeutralPair(
        "eva", "rom", coarse, coarse + shape(4) / 15, np.array([0.2, 9.0, -0.1, 0.4]), np.array(NAMES),
        shape(5),
    )  # fmt: skip


def test_the_neutral_frame_is_corrected_to_the_accurate_neutral(model, pair):
    known = with_known_neutrals(model, TRIANGLES, pair)
    layers = known.predict(pair.features[None], pair.neutral_mm)[0]
    true = correction_layers(pair.coarse_mm, pair.accurate_mm, TRIANGLES[MASK])
    np.testing.assert_allclose(layers, true, atol=1e-5)
    mixture = np.append(known.mixture(pair.features[None], pair.neutral_mm)[0], 1.0)
    moved = (mixture @ known.basis(pair.neutral_mm)[1]).reshape(-1, 3)
    np.testing.assert_allclose(moved, (pair.accurate_mm - pair.coarse_mm)[VERTICES], atol=1e-4)
    assert np.abs(model.predict(pair.features[None], pair.neutral_mm)[0] - true).max() > 0.05


def test_the_expression_is_told_as_before_and_nobody_else_changes(model, pair):
    known = with_known_neutrals(model, TRIANGLES, pair)
    features = np.random.default_rng(6).normal(size=(5, 4))
    of_unseen = features - pair.features + model.neutral_features
    difference = known.predict(features, pair.neutral_mm) - model.predict(of_unseen)
    np.testing.assert_allclose(difference, difference[:1].repeat(5, axis=0), atol=1e-5)
    for other in (None, shape(1), shape(2)):
        np.testing.assert_array_equal(
            known.predict(features, other), model.predict(features, other)
        )


def test_what_all_their_frames_have_in_common_changes_nothing(model, pair):
    features, off = np.random.default_rng(6).normal(size=(5, 4)), np.array([0.4, -0.2, 0.8, 1.5])
    known = with_known_neutrals(model, TRIANGLES, pair).predict(features, pair.neutral_mm)
    pair = replace(pair, features=pair.features + off)
    again = with_known_neutrals(model, TRIANGLES, pair).predict(features + off, pair.neutral_mm)
    np.testing.assert_allclose(again, known, atol=1e-6)


def test_where_h_is_absent_a_subject_stays_unseen(model, pair):
    accurate = pair.accurate_mm.copy()
    accurate[4] = np.nan  # a corner of the second triangle of the mask
    known = with_known_neutrals(model, TRIANGLES, replace(pair, accurate_mm=accurate))
    whole = with_known_neutrals(model, TRIANGLES, pair)
    features = pair.features[None]
    found = known.predict(features, pair.neutral_mm)[0]
    np.testing.assert_allclose(found[0], whole.predict(features, pair.neutral_mm)[0, 0], atol=1e-6)
    unseen = model.predict(model.neutral_features[None])
    np.testing.assert_allclose(found[1], unseen[0, 1], atol=1e-6)


def errors(model, pairs):
    """What is wrong of the layers of each neutral frame (P, 2, 9)."""
    return np.array([
        model.predict(pair.features[None], pair.neutral_mm)[0]
        - correction_layers(pair.coarse_mm, pair.accurate_mm, TRIANGLES[MASK])
        for pair in pairs
    ])  # fmt: skip


@pytest.fixture
def of_take(pair):
    """The same person in other light: the coarse track and the features err by more."""
    return replace(
        pair,
        take="phone",
        coarse_mm=pair.coarse_mm + shape(7) / 60,
        features=pair.features + np.array([0.1, 0.0, -0.1, 0.2]),
    )


def test_of_two_neutrals_the_mean_is_right_and_features_are_the_takes(model, pair, of_take):
    known = with_known_neutrals(model, TRIANGLES, pair, of_take)
    wrong = errors(known, [pair, of_take])
    np.testing.assert_allclose(wrong.mean(axis=0), 0.0, atol=1e-5)
    assert np.abs(wrong).max() > 1e-3
    alone = with_known_neutrals(model, TRIANGLES, None, of_take)
    np.testing.assert_array_equal(known.shifts, alone.shifts)
    np.testing.assert_allclose(errors(alone, [of_take]), 0.0, atol=1e-5)


def test_a_person_of_the_training_is_half_known_already(model, pair, of_take):
    trained, of_rig = (
        replace(each, neutral_mm=shape(1), subject="zoe") for each in (of_take, pair)
    )
    known = with_known_neutrals(model, TRIANGLES, of_rig, trained)
    assert sorted(known.neutrals_mm) == ["ana", "zoe"]
    shift = trained.features - model.neutral_features
    same_features = replace(model, shifts=np.array([shift, model.shifts[1]]))
    before = errors(same_features, [trained])
    np.testing.assert_allclose(errors(known, [trained]), before / 2, atol=1e-5)
    features = np.random.default_rng(6).normal(size=(5, 4))
    np.testing.assert_array_equal(
        known.predict(features, shape(2)), model.predict(features, shape(2))
    )


def test_a_bad_neutral_of_the_take_leaves_that_of_the_person(model, pair, of_take):
    bad = replace(of_take, reason="no contour features")
    known, expected = (
        with_known_neutrals(model, TRIANGLES, pair, other).predict(
            pair.features[None], pair.neutral_mm
        )
        for other in (bad, None)
    )
    np.testing.assert_array_equal(known, expected)


def test_a_bad_pair_and_a_person_of_the_training_change_nothing(model, pair):
    assert (
        with_known_neutrals(model, TRIANGLES, replace(pair, reason="the coarse track failed"))
        is model
    )
    assert with_known_neutrals(model, TRIANGLES, replace(pair, neutral_mm=shape(2))) is model


def test_a_regressor_with_one_bias_learns_a_person_too(model, pair):
    estimator = KernelRegressor(0.1, 0.3).fit(
        np.random.default_rng(0).normal(size=(40, 3)),
        np.random.default_rng(1).normal(size=(40, 30)).astype(np.float32),
    )
    one = replace(model, estimator=estimator, neutrals_mm={}, shifts=np.zeros((0, 0)))
    known = with_known_neutrals(one, TRIANGLES, pair)
    true = correction_layers(pair.coarse_mm, pair.accurate_mm, TRIANGLES[MASK])
    layers = known.predict(pair.features[None], pair.neutral_mm)[0]
    np.testing.assert_allclose(layers, true, atol=1e-5)


def test_other_features_are_refused_with_the_person_named(model, pair):
    with pytest.raises(
        InputError, match=r"subject eva, take rom.*features that are not the regressor's"
    ):
        with_known_neutrals(model, TRIANGLES, replace(pair, feature_names=np.array(NAMES[:3])))


def test_round_trip(pair, tmp_path):
    pair.save(tmp_path / "pair.npz")
    read = NeutralPair.load(tmp_path / "pair.npz")
    assert (read.subject, read.take, read.reason) == ("eva", "rom", "")
    np.testing.assert_array_equal(read.accurate_mm, pair.accurate_mm)
    np.testing.assert_array_equal(read.features, pair.features)


def test_outside_the_training_what_is_regressed_fades_to_its_mean_and_inside_it_counts_in_full(
    model,
):
    features = np.array([[0.1, 0.0, 0.2, 0.1], [3.0, 0.0, -2.0, 1.0], [300.0, 0.0, -200.0, 100.0]])
    novelty = model.novelty(features, shape(1))
    model = replace(model, novelty_limit=1.01 * novelty[0])
    mean, full = model.estimator.mean_mixture(), model.mixture(features, shape(1))
    settings = CorrectionSettings(16.0, 0.0, smooth_frames=0, fade_power=4.0, image=None)
    corrector = SimpleNamespace(model=model, neutral_mm=shape(1), settings=settings)
    faded = Corrector._within_span(corrector, features)
    np.testing.assert_allclose(faded[0], full[0], rtol=1e-5, atol=1e-6)
    shares = np.linalg.norm(faded - mean, axis=1) / np.linalg.norm(full - mean, axis=1)
    np.testing.assert_allclose(shares[1:], (model.novelty_limit / novelty[1:]) ** 4, rtol=1e-3)
    assert shares[2] < shares[1] < 1.0
    corrector.settings = settings.as_in_the_paper()
    np.testing.assert_array_equal(Corrector._within_span(corrector, features), full)
