"""Rounded mouths, which networks draw too wide: the lip ends where the dark of the mouth begins."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.mouths import draw_mouth
from vermilion.contours.holes import hole_edges
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.ridges import InnerCues

STEP = 0.5
PLACES = STEP * np.arange(-60, 21)
CENTRE, OPENING, HEIGHT = np.array([120.0, 150.0]), 9.0, 40.0


def line(*parts):
    """Lightness of a line that runs outwards, `PLACES`: values from a place on."""
    values = np.zeros(len(PLACES))
    for start, value in parts:
        values[start <= PLACES] = value
    return values[None]


def found(lightness, flesh=None):
    """Place of the hole's edge on a line, and how sure it is."""
    flesh = np.ones(lightness.shape, bool) if flesh is None else flesh
    at, sure = hole_edges(lightness, flesh, np.ones(lightness.shape, bool), PLACES)
    return PLACES[at[0]], sure[0]


def test_a_hole_far_inside_is_found():
    place, sure = found(line((-30, 0.03), (-12, 0.4)))
    assert sure == 1
    assert place == pytest.approx(-12, abs=STEP)


def test_the_lips_own_shade_is_no_hole():
    assert found(line((-30, 0.3), (-12, 0.4)))[1] == 0


def test_teeth_end_the_search():
    """The dark behind lower teeth is not the lip's end."""
    lightness = line((-30, 0.03), (-16, 0.75), (-4, 0.4))
    assert found(lightness, lightness < 0.7)[1] == 0


def test_a_line_that_is_not_on_the_lip_finds_nothing():
    lightness = line((-30, 0.4), (-12, 0.03), (-4, 0.4))
    flesh = np.broadcast_to(PLACES < -14, lightness.shape)
    assert found(lightness, flesh)[1] == 0


def test_a_border_far_outside_a_hole_comes_to_its_edge():
    """The rings of the lips are 12 px too wide below; the border would be looked for 4 px about them."""
    image, landmarks, label = draw_mouth(OPENING, HEIGHT, centre=tuple(CENTRE), noise=0.005)
    angle = np.linspace(np.pi, 3 * np.pi, 80, endpoint=False)
    half = np.abs(label.inner.dense(1.0)[:, 0] - CENTRE[0]).max()
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner = CENTRE + circle * np.where(np.sin(angle) > 0, OPENING + 12.0, OPENING)[:, None] * [0, 1]
    inner[:, 0] = CENTRE[0] + half * circle[:, 0]
    outer = CENTRE + circle * [52.0, HEIGHT]
    detector = LandmarkRidgeDetector(reach=0.02)
    inner_map, _ = detector.likelihood(image, landmarks, (outer, inner))
    column = inner_map[:, int(CENTRE[0])]
    below = column.copy()
    below[: int(CENTRE[1])] = 0
    border = label.inner.dense(1.0)
    lower = border[(border[:, 1] > CENTRE[1]) & (np.abs(border[:, 0] - CENTRE[0]) < 3), 1].mean()
    assert below.argmax() + 0.5 == pytest.approx(lower, abs=2.0)


@pytest.mark.parametrize(
    ("teeth", "expected"), [((-5, -1), True), ((1, 5), False), ((-30, -20), False)]
)
def test_a_dark_line_ends_a_lip_where_teeth_lie_inside_it_not_where_they_lie_outside(
    teeth, expected
):
    """Between a tongue and the lower teeth is a dark line as well."""
    angle = np.linspace(np.pi, 3 * np.pi, 80, endpoint=False)
    curve = CENTRE + 60 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y, x = np.mgrid[0:240, 0:240] + 0.5
    outside = np.hypot(x - CENTRE[0], y - CENTRE[1]) - 60
    plane = ((outside > teeth[0]) & (outside < teeth[1])).astype(np.float32)
    cues = InnerCues(plane, plane, plane, plane, plane)
    normals = (curve - CENTRE) / 60
    found = LandmarkRidgeDetector()._before_teeth(curve, normals, cues, STEP, 4)
    assert (found[:, 4] == expected).all()
