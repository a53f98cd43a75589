"""Local binary patterns, their histograms, and the choice of key frames by them (Mono13 5.2)."""

import numpy as np
import pytest

from vermilion.landmarks.binary_patterns import (
    N_BINS,
    N_UNIFORM,
    affine_between,
    chi_squared,
    code_histograms,
    lbp4,
    lbp8,
    uniform_code,
)
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.key_frames import (
    BETWEEN,
    GIVEN,
    NEUTRAL,
    KeyFrameSettings,
    choose_key_frames,
    without_offset,
)


@pytest.fixture
def image():
    return np.random.default_rng(3).integers(0, 120, (20, 24)).astype(np.uint8)


def changes(code):
    bits = f"{code:08b}"
    return sum(a != b for a, b in zip(bits, bits[1:] + bits[0], strict=True))


def test_uniform_codes_are_those_with_at_most_two_changes_round_the_circle():
    bins = uniform_code(np.arange(256, dtype=np.uint8))
    uniform = [code for code in range(256) if changes(code) <= 2]
    assert len(uniform) == 58
    assert sorted(bins[uniform]) == list(range(58))
    assert set(bins[[c for c in range(256) if changes(c) > 2]]) == {N_UNIFORM - 1}


def test_code_of_a_pixel_by_hand():
    pixels = np.array([[9, 1, 1], [1, 5, 9], [1, 1, 1]], dtype=np.uint8)
    # Right is brighter; so is the corner at the upper left, interpolated: 0.5 * 9 + 0.1 * 5 + 0.4.
    assert lbp4(pixels)[1, 1] == 0b0001
    assert lbp8(pixels)[1, 1] == 0b00001001


def test_a_flat_image_has_every_neighbour_not_darker():
    flat = np.full((6, 7), 77, dtype=np.uint8)
    assert (lbp8(flat) == 255).all() and (lbp4(flat) == 15).all()


def test_brightness_and_contrast_do_not_change_codes(image):
    assert np.array_equal(lbp8(image), lbp8(2 * image + 10))
    assert np.array_equal(lbp4(image), lbp4(2 * image + 10))


def test_a_quarter_turn_of_the_image_turns_the_codes(image):
    turned = np.rot90(lbp8(image))  # counterclockwise, as the bits go
    expected = (turned << 2) | (turned >> 6)
    assert np.array_equal(lbp8(np.rot90(image)), expected)
    turned = np.rot90(lbp4(image))
    assert np.array_equal(lbp4(np.rot90(image)), ((turned << 1) | (turned >> 3)) & 15)


def test_histograms_are_shares_of_59_and_16_bins(image):
    boxes = np.array([[0, 0, 6, 5], [6, 5, 10, 10]])
    found = code_histograms(uniform_code(lbp8(image)), lbp4(image), boxes)
    assert found.shape == (2, N_BINS) == (2, 75)
    assert np.allclose(found[:, :N_UNIFORM].sum(axis=1), 1)
    assert np.allclose(found[:, N_UNIFORM:].sum(axis=1), 1)


def test_chi_squared_of_equal_and_of_disjoint_histograms():
    a, b = np.array([0.25, 0.75, 0, 0]), np.array([0, 0, 0.5, 0.5])
    assert chi_squared(a, a) == 0
    assert chi_squared(a, b) == pytest.approx(2) == pytest.approx(chi_squared(b, a))


def test_affine_map_of_points_is_found_exactly():
    rng = np.random.default_rng(0)
    points, matrix = rng.normal(size=(66, 2)), rng.normal(size=(2, 3))
    assert np.allclose(affine_between(points, points @ matrix[:, :2].T + matrix[:, 2]), matrix)


def test_initial_key_frames_are_the_share_nearest_to_the_neutral():
    region = np.full(80, 5.0)
    region[[0, 33]] = [0.0, 1.0]
    kinds = choose_key_frames(region, region, np.zeros(80, bool), KeyFrameSettings(0.025, 50))
    assert kinds == {0: NEUTRAL, 33: NEUTRAL}


def test_long_clips_are_divided_where_the_patches_look_alike():
    region, patch = np.arange(61.0), np.full(61, 9.0)
    patch[[5, 37]] = [0.5, 1.0]  # 5 is too near to the end of the clip to shorten it
    kinds = choose_key_frames(region, patch, np.zeros(61, bool), KeyFrameSettings(0.01, 50))
    assert kinds == {0: NEUTRAL, 37: BETWEEN}


def test_no_clip_is_longer_than_allowed_and_frames_without_a_face_are_no_key_frames():
    rng = np.random.default_rng(5)
    distance = rng.uniform(1, 2, 700)
    lost = rng.random(700) < 0.2
    distance[lost] = np.inf
    kinds = choose_key_frames(distance, distance, np.zeros(700, bool), KeyFrameSettings())
    rows = np.array(sorted(kinds))
    assert np.diff(np.concatenate([[0], rows, [699]])).max() <= 50
    assert not lost[rows].any()


def test_given_frames_are_key_frames():
    distance, given = np.arange(40.0), np.arange(40) == 21
    kinds = choose_key_frames(distance, distance, given, KeyFrameSettings())
    assert kinds == {0: NEUTRAL, 21: GIVEN}


def test_a_constant_offset_in_the_face_is_taken_out_whatever_its_pose():
    rng = np.random.default_rng(1)
    shape, offset = rng.normal(size=(66, 2)) * 50, rng.normal(size=(66, 2))
    offset -= offset.mean(axis=0)
    turn = 2 * np.array([[0.8, -0.6], [0.6, 0.8]])
    detected = np.stack([shape, shape @ turn.T + 7, np.full((66, 2), np.nan)])
    true = np.stack([shape + offset, (shape + offset) @ turn.T + 7])
    track = LandmarkTrack(
        np.arange(4, 7), detected, np.ones((3, 66)), np.array([True, True, False])
    )
    found = without_offset(track, {4: true[0]}).points_px
    assert np.allclose(found[:2], true, atol=1e-9)
    assert np.isnan(found[2]).all()
    assert without_offset(track, {}) is track
