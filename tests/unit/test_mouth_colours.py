"""Colours of lips and of the mouth's inside that a take's frames tell together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.mouths import draw_mouth, ellipse
from vermilion.contours.curves import inside_of, loop_spline
from vermilion.contours.detector_file import load_detector
from vermilion.contours.mouth_colours import MOST_ODDS, lip_odds
from vermilion.contours.ridges import blurred_colours
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_borders
from vermilion.evaluation.contour_error import distance_to_polyline

CENTRE, WIDTH = (120.0, 150.0), 52.0
TONGUE = (0.24, 0.07, 0.075)  # linear; as light as a lip in shade: no hole, no teeth
#: Half heights of the opening, of the lips, and how far outside the landmarks lie.
FRAMES = [(16.0, 34.0, 8.0), (12.0, 30.0, 4.0), (18.0, 36.0, 10.0), (1.0, 22.0, 0.0)]


def frame(opening, height, off, seed=0):
    """Image of a mouth that a tongue fills, landmarks (66, 2), their rings and the true inner border."""
    image, landmarks, label = draw_mouth(opening, height, seed=seed)
    border = label.inner.points_px
    if opening > 5:
        seen = inside_of(border, len(image))
        noise = np.random.default_rng(seed).normal(scale=0.005, size=image.shape)
        image = np.where(seen[..., None], np.asarray(TONGUE) + noise, image).astype(image.dtype)
    rings = ellipse(CENTRE, WIDTH, height, 80), ellipse(CENTRE, 0.75 * WIDTH, opening + off, 80)
    return image, landmarks, rings, border


def learnt(frames, share):
    detector = replace(TrackRidgeDetector(reach=0.02), lips_colours=share)
    images, regions = [], []
    for seed, shape in enumerate(frames):
        image, landmarks, rings, _ = frame(*shape, seed=seed)
        regions.append(detector.region(landmarks, rings))
        images.append(regions[-1].crop(image))
    return learn_borders(detector, images, regions, 0.08, inner=False)


@pytest.fixture(scope="module")
def detector():
    return learnt(FRAMES, 0.5)


def error_px(detector, shape, seed=9):
    image, landmarks, rings, border = frame(*shape, seed=seed)
    region = detector.region(landmarks, rings)
    colours = blurred_colours(region.crop(image))
    outer = loop_spline(detector.outer_border(colours, region)[0])
    found = region.to_image(detector.inner_border(colours, region, outer)[0])
    middle = np.abs(found[:, 0] - CENTRE[0]) < 0.45 * WIDTH
    return distance_to_polyline(found[middle], border, True).mean()


def test_the_border_is_found_far_inside_the_landmarks(detector):
    """Networks draw wide mouths too wide; a tongue is no hole, whose edge alone would be followed."""
    wide = (17.0, 35.0, 10.0)
    assert error_px(detector, wide) < 1.5
    assert error_px(replace(detector, lip_odds=np.zeros(0)), wide) > 3.0


def test_where_the_landmarks_are_right_the_border_stays(detector):
    for shape in ((14.0, 32.0, 0.0), (1.0, 22.0, 0.0)):
        assert error_px(detector, shape) < 1.2


def test_both_lips_are_told_from_the_tongue(detector):
    image, landmarks, rings, border = frame(*FRAMES[0])
    region = detector.region(landmarks, rings)
    odds = lip_odds(detector.lip_odds, blurred_colours(region.crop(image)))
    mouth = inside_of(region.to_region(CENTRE + 0.8 * (border - CENTRE)), region.size_px)
    outer = inside_of(region.to_region(rings[0]), region.size_px)
    lips = outer & ~inside_of(region.to_region(CENTRE + 1.2 * (border - CENTRE)), region.size_px)
    assert np.abs(odds).max() <= MOST_ODDS
    for lip in odds:
        assert np.median(lip[mouth]) < -1.0
        assert np.median(lip[lips]) > 1.0


def test_a_take_of_shut_mouths_tells_nothing():
    assert len(learnt([(1.0, 22.0, 0.0)] * 3, 0.5).lip_odds) == 0


def test_a_single_wide_open_frame_does_not_decide_for_all():
    assert len(learnt([FRAMES[0], FRAMES[3], FRAMES[3]], 0.5).lip_odds) == 0


def test_share_0_learns_nothing():
    assert len(learnt(FRAMES, 0.0).lip_odds) == 0


def test_the_file_has_the_colours(detector, tmp_path):
    detector.save(tmp_path / "detector.npz")
    np.testing.assert_array_equal(
        load_detector(tmp_path / "detector.npz").lip_odds, detector.lip_odds
    )
