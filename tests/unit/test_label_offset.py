"""Labels that lean to one side of the lips' border, held against the images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.mouths import draw_mouth
from tests.unit.test_track_ridge import learnt, rings
from vermilion.contours.label_offset import moved_inwards, outer_offset, without_lean
from vermilion.contours.labels import ContourLabel
from vermilion.contours.training import LabelledFrame
from vermilion.evaluation.contour_error import distance_to_polyline

SHAPES = [(2.0, 20.0), (12.0, 28.0), (7.0, 24.0)]
INTEROCULAR_PX, TOLERANCE, REACH = 200.0, 0.007, 0.025


@pytest.fixture(scope="module")
def detector():
    return learnt()


def labelled(lean_px, scale=1.0):
    """Frames whose outer contours were all drawn so far outside the lips' border."""
    frames = []
    for number, shape in enumerate(SHAPES):
        size = (round(240 * scale),) * 2
        frame = LabelledFrame(*draw_mouth(*shape, scale=scale, size=size, seed=number), number)
        frames.append(moved_inwards(frame, -lean_px / INTEROCULAR_PX))
    return frames


def tracked(number):
    return rings(*SHAPES[number], 6.0, 3.0)


def distance_px(frame):
    """Mean distance of its outer contour to the true one."""
    truth = draw_mouth(*SHAPES[frame.number])[2].outer.points_px
    return distance_to_polyline(frame.label.outer.dense(), truth, True).mean()


@pytest.mark.parametrize("lean_px", [-4.0, -2.0, 0.0, 2.0, 4.0])
def test_the_lean_of_a_label_is_measured(detector, lean_px):
    for number, frame in enumerate(labelled(lean_px)):
        found = INTEROCULAR_PX * outer_offset(frame, detector, tracked(number))
        assert found == pytest.approx(lean_px, abs=0.5)


def test_it_is_the_same_in_a_image_twice_as_large(detector):
    (frame,) = labelled(-2.0, scale=2.0)[:1]
    found = outer_offset(frame, detector, tuple(2.0 * ring for ring in tracked(0)))
    assert INTEROCULAR_PX * found == pytest.approx(-2.0, abs=0.5)


@pytest.mark.parametrize("lean_px", [-3.0, 3.0])
def test_labels_that_lean_are_moved_to_the_border(detector, lean_px):
    drawn = labelled(lean_px)
    moved, rows = without_lean(drawn, detector, tracked, TOLERANCE, REACH)
    for before, after in zip(drawn, moved, strict=True):
        assert distance_px(before) == pytest.approx(3.0, abs=0.3)
        assert distance_px(after) < 0.6
        np.testing.assert_array_equal(before.label.inner.points_px, after.label.inner.points_px)
    side = "outside" if lean_px > 0 else "inside"
    assert all(row.valid and f"{side} the border" in row.reason for row in rows)
    assert all("moved" in row.reason for row in rows)


def test_exact_labels_count_as_drawn(detector):
    drawn = labelled(0.0)
    kept, rows = without_lean(drawn, detector, tracked, TOLERANCE, REACH)
    assert kept == drawn
    assert [row.reason for row in rows] == ["", "", ""]
    assert max(abs(row.figures["outer_offset"]) for row in rows) < TOLERANCE / 2


def test_what_labels_say_of_a_single_frame_stays(detector):
    drawn = labelled(-3.0)
    drawn[1] = moved_inwards(drawn[1], 1.0 / INTEROCULAR_PX)
    moved, _ = without_lean(drawn, detector, tracked, TOLERANCE, REACH)
    assert distance_px(moved[1]) == pytest.approx(1.0, abs=0.4)


def test_labels_of_something_else_are_not_moved_but_named(detector):
    drawn = labelled(-2.0 * REACH * INTEROCULAR_PX)
    kept, rows = without_lean(drawn, detector, tracked, TOLERANCE, REACH)
    assert kept == drawn
    assert all("check labels" in row.reason for row in rows)


def test_a_frame_without_a_track_follows_the_others(detector):
    drawn = labelled(-3.0)
    moved, rows = without_lean(
        drawn, detector, lambda n: tracked(n) if n else None, TOLERANCE, REACH
    )
    assert distance_px(moved[0]) < 0.6
    assert np.isnan(rows[0].figures["outer_offset"])
    kept, rows = without_lean(drawn, detector, lambda n: None, TOLERANCE, REACH)
    assert kept == drawn
    assert [row.reason for row in rows] == ["", "", ""]


def test_a_line_drawn_open_is_closed_where_it_is_moved():
    frame = labelled(0.0)[0]
    outer = replace(frame.label.outer, closed=False)
    moved = moved_inwards(replace(frame, label=ContourLabel(frame.label.inner, outer)), 0.01)
    assert moved.label.outer.closed
