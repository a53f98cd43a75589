"""Contours near tracked lips: borders that a take tells, where the track and single frames err."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.mouths import draw_mouth, ellipse
from vermilion.contours.curves import (
    inside_of,
    loop_spline,
    outward_normals,
    smoothed_halves,
    without_crossing,
)
from vermilion.contours.detector_file import load_detector
from vermilion.contours.ridges import InnerCues, blurred_colours
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_borders, mouth_parts
from vermilion.evaluation.contour_error import distance_to_polyline

CENTRE, WIDTH = (120.0, 150.0), 52.0
SHAPES = [(4.0, 22.0), (12.0, 28.0), (7.0, 24.0), (14.0, 30.0)]


def rings(opening, height, outer_px=0.0, inner_px=0.0):
    """Tracked lips of a drawn mouth, so far outside of the true ones, 80 samples each."""
    return (
        ellipse(CENTRE, WIDTH + outer_px, height + outer_px, 80),
        ellipse(CENTRE, 0.75 * WIDTH + inner_px, opening + inner_px, 80),
    )


def learnt(detector=None, outer_px=6.0, inner_px=3.0, reach=0.08, inner=True):
    detector = detector or TrackRidgeDetector()
    images, regions = [], []
    for seed, (opening, height) in enumerate(SHAPES):
        image, landmarks, _ = draw_mouth(opening, height, seed=seed)
        regions.append(detector.region(landmarks, rings(opening, height, outer_px, inner_px)))
        images.append(regions[-1].crop(image))
    return learn_borders(detector, images, regions, reach, inner)


def borders_px(detector, image, landmarks, lips):
    """Outer and inner border in the image."""
    region = detector.region(landmarks, lips)
    colours = blurred_colours(region.crop(image))
    outer = loop_spline(detector.outer_border(colours, region)[0])
    return tuple(
        region.to_image(curve)
        for curve in (outer, detector.inner_border(colours, region, outer)[0])
    )


@pytest.fixture(scope="module")
def detector():
    return learnt()


@pytest.mark.parametrize("outer_px", [-6.0, 6.0, 14.0])
def test_what_all_frames_share_is_learnt(outer_px):
    outer_alone = TrackRidgeDetector(lips_colours=0.0, lips_heights=0.0)
    found = learnt(outer_alone, outer_px=outer_px, inner=False).outer_offset * 200
    along = np.r_[8:33, 48:73]  # the corners have little lip beside them
    assert found[along] == pytest.approx(np.full(len(along), -outer_px), abs=1.0)


def test_borders_of_a_frame_that_was_not_learnt_from(detector):
    image, landmarks, label = draw_mouth(8.0, 27.0, seed=9)
    outer, inner = borders_px(detector, image, landmarks, rings(8.0, 27.0, 6.0, 3.0))
    assert distance_to_polyline(outer, label.outer.points_px, True).mean() < 0.7
    assert distance_to_polyline(inner, label.inner.points_px, True).mean() < 1.2


def test_a_frame_may_leave_the_takes_border_by_its_reach(detector):
    image, landmarks, label = draw_mouth(8.0, 27.0, seed=9)
    outer, _ = borders_px(detector, image, landmarks, rings(8.0, 27.0, 9.0, 3.0))
    assert distance_to_polyline(outer, label.outer.points_px, True).mean() < 1.2
    far, _ = borders_px(detector, image, landmarks, rings(8.0, 27.0, 30.0, 3.0))
    assert distance_to_polyline(far, label.outer.points_px, True).mean() > 15.0


@pytest.mark.parametrize("rolled_px", [-9.0, 9.0])
def test_a_rolled_lip_is_found_where_it_ends(detector, rolled_px):
    """Tracks do not follow rolls: the ring keeps the height of lips that are rolled in or out."""
    image, landmarks, label = draw_mouth(6.0, 25.0, seed=9)
    tracked = rings(6.0, 25.0 - rolled_px, 0.0, 3.0)
    tracked[0][40:] = rings(6.0, 25.0)[0][40:]  # the upper lip alone
    start = tracked[0] + 6.0 * outward_normals(tracked[0])  # what all frames share
    along = slice(5, 36)
    for reach, most in ((0.05, 1.0), (0.0001, np.inf)):
        found = replace(detector, lip_reach=reach)
        outer, _ = borders_px(found, image, landmarks, (start, tracked[1]))
        away = distance_to_polyline(
            outer[3 * along.start : 3 * along.stop], label.outer.points_px, True
        )
        assert away.mean() < most
    assert away.mean() > 2.0  # place by place alone, it is not


@pytest.mark.parametrize(("dark", "touching"), [(0.05, 0.0), (0.3, 0.5), (0.9, 1.0)])
def test_what_is_nearly_black_between_lips_is_a_hole_and_no_contact(detector, dark, touching):
    """`dark` is the line's lightness against the lips'; all of it lies within the reach of contacts."""
    rows = np.abs(np.arange(240) + 0.5 - CENTRE[1])
    lightness = np.repeat(np.where(rows < 3, 0.4 * dark, 0.4)[:, None], 240, axis=1)
    lip = inside_of(ellipse(CENTRE, WIDTH, 26.0, 80), 240)
    planes = [plane.astype(np.float32) for plane in (lightness, lightness, lip, lip)]
    curve = ellipse(CENTRE, 0.75 * WIDTH, 0.01, 80)
    points = curve[:, None] + np.array([0.0, 1.0]) * np.arange(-9, 10)[:, None]
    contact = detector._contact(curve, points, InnerCues(*planes, np.zeros_like(planes[0])))
    np.testing.assert_allclose(contact, touching, atol=0.01)


def test_parts_of_a_mouth_are_full_in_their_middles_and_the_corners_belong_to_no_lip():
    upper, lower, right, left = mouth_parts(80)
    middles = [part.argmax() for part in (upper, lower, right, left)]
    assert middles == [20, 60, 0, 40]
    np.testing.assert_allclose([upper[20], lower[60], right[0], left[40]], 1)
    np.testing.assert_array_equal(upper[40:], 0)
    np.testing.assert_array_equal(lower[:40], 0)
    np.testing.assert_allclose([upper[0], lower[40], right[40], left[0]], 0, atol=1e-7)
    np.testing.assert_allclose(right[1:], right[:0:-1], atol=1e-7)  # as far along either lip
    np.testing.assert_allclose(np.roll(right, 40), left)


def test_a_corner_that_comes_in_is_found(detector):
    """Tracks keep mouths that open wide too wide."""
    image, landmarks, label = draw_mouth(14.0, 30.0, seed=9)
    outer, inner = rings(14.0, 30.0, 0.0, 3.0)
    out = outer + 6.0 * outward_normals(outer)
    out += 10.0 * mouth_parts(80)[2][:, None] * outward_normals(outer)
    near = np.r_[:18, -18:0]  # of 240
    error = []
    for reach in (0.05, 0.0001):
        found = replace(detector, lip_reach=reach)
        border, _ = borders_px(found, image, landmarks, (out, inner))
        error.append(distance_to_polyline(border[near], label.outer.points_px, True).mean())
    assert error[0] < 0.5
    assert error[1] > 1.5


def test_halves_that_pass_each_other_meet():
    curve = ellipse(CENTRE, WIDTH, 10.0, 80)
    np.testing.assert_array_equal(without_crossing(curve), curve)
    crossed = curve.copy()
    crossed[1:9, 1], crossed[:71:-1, 1] = curve[:71:-1, 1], curve[1:9, 1]
    met = without_crossing(crossed)
    np.testing.assert_allclose(met[1:9], met[:71:-1])
    np.testing.assert_array_equal(met[9:72], curve[9:72])


def test_a_shadow_that_one_light_casts_on_the_skin_is_not_lip(detector):
    image, landmarks, label = draw_mouth(8.0, 27.0, seed=9)
    rows = np.arange(240)
    shade = np.where((rows > 183) & (rows < 189), 0.5, 1.0)[:, None, None]  # under the lower lip
    lips = rings(8.0, 27.0, 6.0, 3.0)
    outer, _ = borders_px(detector, image * shade, landmarks, lips)
    assert distance_to_polyline(outer, label.outer.points_px, True).max() < 3.5


def test_maps_are_ridges_about_the_true_contours(detector):
    image, landmarks, label = draw_mouth(8.0, 27.0, seed=9)
    maps = detector.likelihood(image, landmarks, rings(8.0, 27.0, 6.0, 3.0))
    for plane, line in zip(maps, (label.inner, label.outer), strict=True):
        rows, columns = np.nonzero(plane > 0.5 * plane.max())
        points = np.stack([columns, rows], axis=1) + 0.5
        assert distance_to_polyline(points, line.points_px, True).mean() < 2.0
        assert 0.4 < plane.max() <= 1


def test_the_least_reaches_and_the_least_region_serve():
    detector = TrackRidgeDetector(
        interocular_size_px=60.0, reach=0.001, frame_reach=0.001, lip_reach=0.001
    )
    found = learnt(detector, outer_px=0.0, inner_px=0.0, reach=0.001)
    image, landmarks, _ = draw_mouth(8.0, 27.0, seed=9)
    maps = found.likelihood(image, landmarks, rings(8.0, 27.0))
    assert all(np.isfinite(plane).all() and plane.max() > 0.3 for plane in maps)


def test_nothing_to_see_leaves_the_track_where_it_is():
    detector, (_, landmarks, _) = TrackRidgeDetector(), draw_mouth()
    flat = np.full((240, 240, 3), 0.2, dtype=np.float32)
    region = detector.region(landmarks, rings(10.0, 26.0))
    found = learn_borders(detector, [region.crop(flat)], [region], 0.08)
    assert np.abs(found.outer_offset).max() < 0.01
    maps = found.likelihood(flat, landmarks, rings(10.0, 26.0))
    assert all(np.isfinite(plane).all() for plane in maps)


def test_smoothing_takes_the_meshs_edges_and_leaves_the_corners():
    true = ellipse(CENTRE, WIDTH, 26.0, 80)
    jagged = true + 0.5 * (-1.0) ** np.arange(80)[:, None]
    smooth = smoothed_halves(jagged, 6)
    np.testing.assert_array_equal(smooth[[0, 40]], jagged[[0, 40]])
    between = smooth[np.r_[8:33, 48:73]]  # a smoothed bend is a flatter one
    assert distance_to_polyline(between, true, True).max() < 0.35


def test_the_file_says_all(detector, tmp_path):
    detector.save(tmp_path / "detector.npz")
    again = load_detector(tmp_path / "detector.npz")
    assert isinstance(again, TrackRidgeDetector)
    image, landmarks, _ = draw_mouth(8.0, 27.0, seed=9)
    lips = rings(8.0, 27.0, 6.0, 3.0)
    for one, other in zip(
        detector.likelihood(image, landmarks, lips),
        again.likelihood(image, landmarks, lips),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


def test_a_narrow_opening_of_dense_landmarks_stays_open():
    """Their rings are off by what differs from frame to frame: outside where mouths are wide open."""
    detector = TrackRidgeDetector(reach=0.02)
    images, regions = [], []
    for seed, (opening, height) in enumerate(SHAPES):
        image, landmarks, _ = draw_mouth(opening, height, seed=seed)
        off = 4.0 if opening > 5 else 0.0
        regions.append(detector.region(landmarks, rings(opening, height, 0.0, off)))
        images.append(regions[-1].crop(image))
    image, landmarks, label = draw_mouth(3.0, 24.0, seed=9)
    error, height = {}, {}
    for inner in (True, False):
        found = learn_borders(detector, images, regions, 0.08, inner)
        border = borders_px(found, image, landmarks, rings(3.0, 24.0))[1]
        error[inner] = distance_to_polyline(border, label.inner.points_px, True).mean()
        height[inner] = np.ptp(border[:, 1])
    assert error[False] < 1.0
    assert error[True] > 2 * error[False]
    assert 5.0 < height[False] < 9.0  # it is 6
    assert height[True] < 2.0
