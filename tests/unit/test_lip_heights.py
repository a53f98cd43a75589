"""Heights of a person's lips that a take's frames tell together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.mouths import LIP, draw_mouth, ellipse
from vermilion.contours.curves import inside_of, loop_spline
from vermilion.contours.detector_file import load_detector
from vermilion.contours.lip_heights import (
    LEAST_FRAMES,
    SHARES,
    USUAL,
    SeenLips,
    learn_lip_heights,
    lip_heights,
    seen_lips,
    told_heights,
    unusual_heights,
)
from vermilion.contours.ridges import blurred_colours
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_borders
from vermilion.evaluation.contour_error import distance_to_polyline
from vermilion.imaging.images import srgb_to_linear

CENTRE, WIDTH = (120.0, 150.0), 52.0
OPENINGS = (8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0)
INSIDE_PX = 1.0  # the landmarks' inner ring lies so far inside the border, in all frames alike
TEETH_PX = 8.0  # height of what is seen of the teeth


def frame(opening, shaded_teeth=False, seed=0):
    """Image of an open mouth, landmarks (66, 2), their rings and the true inner border (n, 2).

    `shaded_teeth`: below the upper lip stand teeth in its own shade, of its own colour.
    """
    height = opening + 15.0
    image, landmarks, label = draw_mouth(opening, height, seed=seed)
    border = label.inner.points_px
    if shaded_teeth:
        size = len(image)
        below = inside_of(border + np.array([0.0, TEETH_PX]), size)
        teeth = inside_of(border, size) & ~below & (np.arange(size)[:, None] < CENTRE[1])
        colour = srgb_to_linear(np.asarray(LIP))
        noise = np.random.default_rng(seed).normal(scale=0.005, size=image.shape)
        image = np.where(teeth[..., None], colour + noise, image).astype(image.dtype)
    inner = ellipse(CENTRE, 0.75 * WIDTH - INSIDE_PX, opening - INSIDE_PX, 80)
    return image, landmarks, (ellipse(CENTRE, WIDTH, height, 80), inner), border


def learnt(share=1.0, openings=OPENINGS, **others):
    detector = TrackRidgeDetector(reach=0.02, lips_heights=share, **others)
    images, regions = [], []
    for seed, opening in enumerate(openings):
        image, landmarks, rings, _ = frame(opening, seed=seed)
        regions.append(detector.region(landmarks, rings))
        images.append(regions[-1].crop(image))
    return learn_borders(detector, images, regions, 0.08, inner=False)


@pytest.fixture(scope="module")
def detector():
    return learnt()


def upper_error_px(detector, opening, shaded_teeth):
    """Mean distance of the found upper border to the true one."""
    image, landmarks, rings, border = frame(opening, shaded_teeth, seed=9)
    region = detector.region(landmarks, rings)
    colours = blurred_colours(region.crop(image))
    outer = loop_spline(detector.outer_border(colours, region)[0])
    found = region.to_image(detector.inner_border(colours, region, outer)[0])
    upper = (np.abs(found[:, 0] - CENTRE[0]) < 0.4 * WIDTH) & (found[:, 1] < CENTRE[1])
    return distance_to_polyline(found[upper], border, True).mean()


def test_teeth_of_the_lips_colour_are_no_lip(detector):
    """No edge parts them from the lip: only the other frames tell how high the lip is."""
    assert upper_error_px(replace(detector, usual_heights=np.zeros(0)), 14.0, True) > 3.0
    assert upper_error_px(detector, 14.0, True) < 1.0


def test_a_clear_border_stays(detector):
    assert upper_error_px(detector, 12.0, False) < 1.0


def test_the_landmarks_error_that_frames_share_is_learnt(detector):
    lips = 200 * detector.usual_heights[:, 4:-4]
    assert lips[..., 1] - lips[..., 0] == pytest.approx(-INSIDE_PX, abs=0.6)


def test_heights_are_distances_to_the_outer_border():
    outer = loop_spline(ellipse((100.0, 100.0), 60.0, 30.0))
    found = lip_heights(loop_spline(ellipse((100.0, 100.0), 50.0, 10.0)), outer)
    assert found[:, len(SHARES) // 2] == pytest.approx([20.0, 20.0], abs=0.1)
    turned = np.array([[0.8, -0.6], [0.6, 0.8]])
    inner = loop_spline(ellipse((100.0, 100.0), 50.0, 10.0))
    np.testing.assert_allclose(lip_heights(inner @ turned.T, outer @ turned.T), found, atol=0.02)


def seen_in(heights, placed=None, width=0.5):
    """Lips that landmarks see; `placed` as high as `heights` where nothing else is said."""
    heights = np.broadcast_to(np.asarray(heights, dtype=float), (2, len(SHARES)))
    return SeenLips(heights, heights if placed is None else placed, width)


def test_a_third_of_wrong_frames_does_not_move_the_told_heights():
    random = np.random.default_rng(3)
    seen = 0.08 + 0.02 * random.random((30, 2, 1)) + np.zeros((30, 2, len(SHARES)))
    own = 0.7 * seen + 0.01
    placed = own + 0.012  # the landmarks' inner ring lies too far inside, in all frames alike
    found = own + 0.001 * random.standard_normal(seen.shape)
    found[::3, 0] += 0.05  # the upper lip's border below the teeth
    lips = [seen_in(*pair) for pair in zip(seen, placed, strict=True)]
    usual, width = learn_lip_heights(lips, list(found))
    told, _ = told_heights(usual, width, lips[0])
    np.testing.assert_allclose(told, own[0], atol=0.002)
    assert usual[..., 2] == pytest.approx(0.7, abs=0.1)
    assert usual[1, :, 3] == pytest.approx(-0.012, abs=0.001)


def test_both_that_landmarks_say_count_alike():
    """Where their outer ring is wrong in a frame, only one of the two told heights is."""
    usual = np.tile([0.1, 0.09, 1.0, 0.0], (2, len(SHARES), 1))
    placed = np.full((2, len(SHARES)), 0.09)
    right = told_heights(usual, 0.5, seen_in(0.1, placed))[0]
    assert right == pytest.approx(0.09)
    assert told_heights(usual, 0.5, seen_in(0.12, placed))[0] == pytest.approx(right + 0.01)
    assert told_heights(usual, 0.5, seen_in(0.1, placed + 0.02))[0] == pytest.approx(right + 0.01)


def test_lips_unlike_the_takes_are_told_less_surely():
    line = np.tile([0.1, 0.09, 0.8, 0.0], (2, len(SHARES), 1))
    assert told_heights(line, 0.5, seen_in(0.1))[1] == pytest.approx(USUAL)
    assert told_heights(line, 0.5, seen_in(0.1, width=0.6))[1] == pytest.approx(USUAL)
    higher = told_heights(line, 0.5, seen_in(0.2))[1]
    pursed = told_heights(line, 0.5, seen_in(0.1, width=0.35))[1]
    assert (higher > 2 * USUAL).all()
    assert (pursed > 2 * USUAL).all()


def test_the_told_height_costs_nothing_and_corners_are_not_told(detector):
    _, landmarks, rings, _ = frame(12.0)
    region = detector.region(landmarks, rings)
    outer = loop_spline(region.outer_px)
    seen = seen_lips(region, outer, 200.0)
    line = np.zeros((2, len(SHARES), 4))  # 20 px, whatever landmarks say
    line[..., 0], line[..., 1], line[..., 3] = seen.heights, 0.1, 0.1 - seen.placed
    cost = unusual_heights((line, seen.width), region, outer, 200.0)
    middle = int(region.outer_px[:, 0].mean())
    top, bottom = int(outer[:, 1].min()), int(outer[:, 1].max())
    assert cost[0, top + 20, middle] < 0.2
    assert cost[1, bottom - 20, middle] < 0.2
    assert cost[0, top + 26, middle] > 4.0
    corner = outer[0].astype(int)
    assert (cost[:, corner[1], : corner[0] + 8] == 0).all()


def test_a_higher_lip_costs_more_than_a_lower_one(detector):
    """Teeth, gums and tongues make lips higher; hardly anything makes them lower."""
    _, landmarks, rings, _ = frame(12.0)
    region = detector.region(landmarks, rings)
    outer = loop_spline(region.outer_px)
    seen = seen_lips(region, outer, 200.0)
    line = np.zeros((2, len(SHARES), 4))
    line[..., 0], line[..., 1], line[..., 3] = seen.heights, 0.1, 0.1 - seen.placed
    cost = unusual_heights((line, seen.width), region, outer, 200.0)
    middle, top = int(region.outer_px[:, 0].mean()), int(outer[:, 1].min())
    assert cost[0, top + 23, middle] > 2 * cost[0, top + 17, middle] > 0


def test_few_frames_and_weight_0_learn_nothing():
    for options in ({"openings": OPENINGS[: LEAST_FRAMES - 1]}, {"share": 0.0}):
        assert len(learnt(**options, lips_colours=0.0).usual_heights) == 0
    few = list(np.full((LEAST_FRAMES - 1, 2, len(SHARES)), 0.1))
    lips = [SeenLips(height, height, 0.5) for height in few]
    assert len(learn_lip_heights(lips, few)[0]) == 0


def test_the_file_has_the_heights(detector, tmp_path):
    detector.save(tmp_path / "detector.npz")
    loaded = load_detector(tmp_path / "detector.npz")
    np.testing.assert_array_equal(loaded.usual_heights, detector.usual_heights)
    assert loaded.usual_width == detector.usual_width > 0
    assert loaded.lips_heights == detector.lips_heights
