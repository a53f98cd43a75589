"""Labels beside the lips' border, held against the images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.mouths import draw_mouth
from tests.unit.test_track_ridge import learnt, rings
from vermilion.contours.curves import outward_normals
from vermilion.contours.labelled_frames import FAR, LabelledFrame, offset_rows, outer_offset
from vermilion.contours.labels import ContourLabel, Polyline

SHAPES = [(2.0, 20.0), (12.0, 28.0), (7.0, 24.0)]
INTEROCULAR_PX = 200.0


@pytest.fixture(scope="module")
def detector():
    return learnt()


def labelled(offset_px, scale=1.0):
    """Frames whose outer contours were all drawn so far outside the lips' border."""
    frames = []
    for number, shape in enumerate(SHAPES):
        size = (round(240 * scale),) * 2
        frame = LabelledFrame(*draw_mouth(*shape, scale=scale, size=size, seed=number), number)
        curve = frame.label.outer.dense(1.0)[:-1]
        curve = curve + scale * offset_px * outward_normals(curve)
        frames.append(replace(frame, label=ContourLabel(frame.label.inner, Polyline(curve, True))))
    return frames


def tracked(number):
    return rings(*SHAPES[number], 6.0, 3.0)


@pytest.mark.parametrize("offset_px", [-4.0, -2.0, 0.0, 2.0, 4.0])
def test_how_far_a_label_lies_from_the_border_is_measured(detector, offset_px):
    for number, frame in enumerate(labelled(offset_px)):
        found = INTEROCULAR_PX * outer_offset(frame, detector, tracked(number))
        assert found == pytest.approx(offset_px, abs=0.5)


def test_it_is_the_same_in_an_image_twice_as_large(detector):
    (frame,) = labelled(-2.0, scale=2.0)[:1]
    found = outer_offset(frame, detector, tuple(2.0 * ring for ring in tracked(0)))
    assert INTEROCULAR_PX * found == pytest.approx(-2.0, abs=0.5)


@pytest.mark.parametrize(("offset_px", "side"), [(-3.0, "inside"), (3.0, "outside")])
def test_labels_far_from_the_border_are_warned_of(detector, offset_px, side):
    rows = offset_rows(labelled(offset_px), detector, tracked)
    assert all(row.valid and f"{side} the border" in row.reason for row in rows)
    assert all("check" in row.reason for row in rows)


def test_exact_labels_say_nothing(detector):
    rows = offset_rows(labelled(0.0), detector, tracked)
    assert [row.reason for row in rows] == ["", "", ""]
    assert max(abs(row.figures["outer_offset"]) for row in rows) < FAR / 2


def test_a_frame_without_a_track_follows_the_others(detector):
    rows = offset_rows(labelled(-3.0), detector, lambda n: tracked(n) if n else None)
    assert np.isnan(rows[0].figures["outer_offset"])
    assert all("check" in row.reason for row in rows)
    rows = offset_rows(labelled(-3.0), detector, lambda n: None)
    assert [row.reason for row in rows] == ["", "", ""]
