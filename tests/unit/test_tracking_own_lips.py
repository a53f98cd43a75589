"""A mouth that the tracker's identities cannot show: the neutral's lips lie where they are seen."""

from __future__ import annotations

import numpy as np
import pytest

from tests import heads
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import MOUTH
from vermilion.landmarks.sets import IBUG66, MEDIAPIPE478
from vermilion.tracking.identity.landmark_identity import IdentityFit
from vermilion.tracking.identity.lip_offset import OwnLips, lip_offset
from vermilion.tracking.identity.sampling import tells_lips
from vermilion.tracking.image_fit.take import DenseLips
from vermilion.tracking.landmark_fit.expression import LandmarkFitSettings
from vermilion.tracking.result import Identity

LOWER_MM = 3.0


PRIOR = OwnLips(range_mm=10.0, sigma_mm=2.0, noise_mm=0.3)


@pytest.fixture(scope="module")
def model():
    return heads.small_tracker()


@pytest.fixture(scope="module")
def fit(model):
    """All landmarks are seen beside the model's: the mouth's 3 mm lower, the others 5 mm to the side."""
    offset = np.zeros((66, 3))
    offset[:, 0] = 5.0
    offset[MOUTH] = [0.0, -LOWER_MM, 0.0]
    return IdentityFit(np.zeros(model.n_identities), offset, {}, 0.0)


def test_the_lips_move_to_where_they_are_seen_and_the_rest_stays(model, fit):
    neutral = model.neutral_of(fit.identity)
    moved = lip_offset(model, neutral, fit.landmark_offset_mm, PRIOR)
    np.testing.assert_allclose(
        moved[model.landmarks[MOUTH]], fit.landmark_offset_mm[MOUTH], atol=0.4
    )
    mouth = neutral[model.landmarks[MOUTH]]
    away = np.linalg.norm(neutral[:, None] - mouth[None], axis=2).min(axis=1)
    assert np.abs(moved[away > 45]).max() < 0.5
    assert np.abs(moved[:, 0]).max() < 0.5


def test_the_meshes_of_a_person_have_their_own_lips(model, fit):
    own, plain = (Identity.of(fit, model, [], own_lips=on) for on in (PRIOR, None))
    weights = np.full((1, model.n_expressions), 0.3)
    np.testing.assert_allclose(
        plain.vertices(model, weights), model.vertices(fit.identity, weights)
    )
    lower = plain.vertices(model, weights) - own.vertices(model, weights)
    assert own.has_own_lips(model)
    assert not plain.has_own_lips(model)
    np.testing.assert_allclose(lower[0, model.landmarks[MOUTH], 1], LOWER_MM, atol=0.4)


@pytest.mark.parametrize(("landmark_set", "expected"), [(IBUG66, False), (MEDIAPIPE478, True)])
def test_dense_landmarks_alone_tell_lips(tmp_path, landmark_set, expected):
    n = landmark_set.n_points
    track = LandmarkTrack(
        np.arange(2), np.zeros((2, n, 2)), np.ones((2, n)), np.ones(2, bool), landmark_set
    )
    track.save(tmp_path / "landmarks.npz")
    assert tells_lips([str(tmp_path / "landmarks.npz")]) is expected


def test_samples_at_the_opening_are_not_compared_and_those_of_the_lips_are(model):
    """Teeth would be taken for lips; without the lips' own colour their motion in depth is lost."""
    neutral = model.neutral_of(np.zeros(model.n_identities))
    found = DenseLips(opening_mm=1.5, noise_share=0.25).hides(model, neutral, neutral)
    assert found[model.inner_contour].all()
    assert not found[model.outer_contour].any()
    assert found[model.regions["vermilion_lower"]].mean() < 0.5


def test_landmarks_of_the_mouth_alone_are_sharper():
    settings = LandmarkFitSettings()
    sharp = DenseLips(opening_mm=1.5, noise_share=0.25).sharpened(settings)
    ratio = sharp.noise.per_landmark(IBUG66) / settings.noise.per_landmark(IBUG66)
    assert np.allclose(ratio[MOUTH], 0.25)
    assert np.allclose(np.delete(ratio, MOUTH), 1.0)
