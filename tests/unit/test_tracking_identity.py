"""Identity, landmark offsets and focal length of a known person."""

import numpy as np
import pytest

from tests.unit.synthetic_face import synthetic_model
from tests.unit.test_tracking_motion import true_motion
from vermilion.config.tracking import TrackingConfig
from vermilion.geometry.rotations import rotation_matrix
from vermilion.landmarks.scheme import EYE_CORNERS
from vermilion.storage.errors import InputError
from vermilion.tracking.identity.landmark_identity import IdentitySettings, TakeSample, fit_identity
from vermilion.tracking.identity.sampling import spread_frames
from vermilion.tracking.landmark_fit.expression import LandmarkFitSettings
from vermilion.tracking.landmark_fit.observation import LandmarkNoise, Observations, project
from vermilion.tracking.landmark_fit.shape import (
    LandmarkShape,
    landmark_identities,
    without_uniform_scale,
)

MODEL = synthetic_model()
PERSON = np.array([1.2, -0.8, 0.5, 1.0])


def sample(focal_px=1400.0, guess=None, depth=1.0, noise_px=0.0, name="rom"):
    rotation, translation, weights = true_motion(12)
    weights[0] = 0.0
    shape = LandmarkShape.of(MODEL, PERSON)
    points = shape.points(weights) @ np.swapaxes(rotation, 1, 2) + depth * translation[:, None]
    image = project(points, focal_px)
    image = image + noise_px * np.random.default_rng(1).normal(size=image.shape)
    seen = Observations(image, np.ones((12, 66)), np.ones(12, dtype=bool))
    neutral = np.arange(12) == 0
    return TakeSample(name, seen, guess or focal_px, guess is None, neutral)


def tight():
    """Priors for landmarks that are exact."""
    exact = LandmarkNoise(0.002, 0.002, 0.002, 0.002, 0.002)
    return IdentitySettings(
        fit=LandmarkFitSettings(noise=exact, weight_sigma=5.0, jaw_slide=1.0),
        bias=exact,
        focal_sigma=0.5,
        iterations=200,
    )


def test_the_person_comes_back_from_clean_landmarks():
    found = fit_identity(MODEL, [sample()], tight())
    wanted = np.tensordot(
        PERSON, without_uniform_scale(landmark_identities(MODEL), MODEL.neutral_mm), 1
    )
    got = np.tensordot(
        found.identity, without_uniform_scale(landmark_identities(MODEL), MODEL.neutral_mm), 1
    )
    assert np.abs(got - wanted).mean() < 0.25  # mm
    assert found.reprojection_px < 0.3


def test_unknown_focal_length_is_found_within_ten_percent():
    near = 0.5  # a head at 350 mm: perspective is strong enough to tell
    found = fit_identity(MODEL, [sample(1400.0, guess=1000.0, depth=near)], tight())
    assert found.focal_px["rom"] == pytest.approx(1400.0, rel=0.10)


def test_known_focal_lengths_stay():
    found = fit_identity(MODEL, [sample(1400.0), sample(900.0, name="phone")], tight())
    assert found.focal_px == {"rom": 1400.0, "phone": 900.0}


def test_bias_of_the_detector_does_not_become_a_person():
    """Landmarks of one group off by a constant are offsets, not identity or size."""
    biased = sample(noise_px=1.0)
    biased.seen.image[:, 17:27, 1] -= 6.0
    plain = fit_identity(MODEL, [sample(noise_px=1.0)])
    found = fit_identity(MODEL, [biased])
    assert np.abs(found.identity - plain.identity).max() < 0.8
    raised = (found.landmark_offset_mm - plain.landmark_offset_mm)[17:27, 1]
    assert raised.mean() > 1.0  # of 3 mm


def test_no_landmarks_in_any_take_is_an_error():
    empty = sample()
    empty.seen.valid[:] = False
    with pytest.raises(InputError, match="landmark"):
        fit_identity(MODEL, [empty])


def test_uniform_growth_is_taken_out():
    centred = MODEL.neutral_mm - MODEL.neutral_mm.mean(axis=0)
    growth = 0.05 * centred[None]
    assert np.allclose(without_uniform_scale(growth, MODEL.neutral_mm), 0, atol=1e-12)
    corners = MODEL.neutral_mm[EYE_CORNERS]
    assert np.linalg.norm(corners[0] - corners[1]) == pytest.approx(92.0)


def test_identity_does_not_depend_on_the_world_turning():
    """The same images turned in the plane give the same person."""
    turned = sample()
    turn = rotation_matrix(np.array([0, 0, 0.3]))[:2, :2]
    rolled = Observations(turned.seen.image @ turn.T, turned.seen.trust, turned.seen.valid)
    a = fit_identity(MODEL, [sample()])
    b = fit_identity(MODEL, [TakeSample("rom", rolled, 1400.0, True, turned.neutral)])
    assert np.abs(a.identity - b.identity).max() < 0.02


def test_sampled_frames_are_spread_and_valid():
    valid = {"a": np.arange(100) % 2 == 0, "b": np.zeros(5, bool), "c": np.ones(3, bool)}
    chosen = spread_frames(valid, 12)
    assert set(chosen) == {"a", "c"}
    assert valid["a"][chosen["a"]].all() and len(chosen["a"]) == 6
    assert chosen["a"][0] == 0 and chosen["a"][-1] == 98
    assert list(chosen["c"]) == [0, 1, 2]


def test_one_bias_of_a_configuration_leaves_the_others():
    bias = TrackingConfig(identity={"bias": {"jaw": 0.1}}).identity.bias
    assert (bias.jaw, bias.mouth) == (0.1, IdentitySettings().bias.mouth)
