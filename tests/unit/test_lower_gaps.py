"""The dark between upper teeth and a lower lip: the border is the lip's edge, not the teeth's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.unit.mouths import SKIN, ellipse
from vermilion.contours.curves import outward_normals
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.lower_gaps import COST, lower_gaps
from vermilion.imaging.images import srgb_to_linear

CENTRE, WIDTH, HEIGHT, OPENING = (120.0, 150.0), 52.0, 28.0, 11.0
STEP, COUNT = 0.5, 8
SOFT_PX = 2.5  # deviation of the blur where the lip turns into the gap
LIP, TEETH, GAP = (0.78, 0.52, 0.52), (0.85, 0.83, 0.78), (0.20, 0.10, 0.10)


def lines(below, above=0.5):
    """Gap and cost of a circle's places, whose lightness outside of it is `below` in the lower half."""
    curve = ellipse(CENTRE, 40.0, 40.0, 80)
    y, x = np.mgrid[0:240, 0:240] + 0.5
    away = np.hypot(x - CENTRE[0], y - CENTRE[1]) - 40.0
    light = np.where(y < CENTRE[1], above, below(away)).astype(np.float32)
    lip = (away < 30.0).astype(np.float32)
    return lower_gaps((light, lip), curve, outward_normals(curve), STEP, COUNT)


def below_middle(values):
    """Of the line that runs straight down."""
    return values[60]


def test_each_pixel_of_a_gap_outside_a_place_costs_the_same():
    gap, cost = lines(lambda away: np.where((away > -2) & (away < 2), 0.1, 0.5))
    assert below_middle(gap)[COUNT] == 1
    assert below_middle(cost)[0] == pytest.approx(4 * COST, abs=0.5)
    assert below_middle(cost)[COUNT] == pytest.approx(2 * COST, abs=0.5)
    assert below_middle(cost)[-1] == 0


def test_dark_corners_are_no_gap():
    gap, cost = lines(lambda away: np.where((away > -2) & (away < 2), 0.1, 0.5))
    for values in (gap, cost):
        assert not values[[40, 41, 42, 43, 77, 78, 79]].any()


def test_a_lips_own_shade_is_no_gap():
    gap, cost = lines(lambda away: np.where(away < 2, 0.35, 0.5))
    assert not gap.any()
    assert not cost.any()


def test_the_upper_lip_may_end_in_its_shade():
    gap, cost = lines(lambda away: np.full_like(away, 0.5), above=0.1)
    assert not gap[4:36].any()
    assert not cost[4:36].any()


def mouth(gap_px):
    """A mouth whose upper teeth end so far above the lower lip, and the rings of its lips.

    The eyes' outer corners are 200 px apart; (h, w, 3) linear, landmarks (66, 2), rings (80, 2).
    """
    image = np.full((240, 240, 3), SKIN, dtype=np.float32)
    outer, inner = ellipse(CENTRE, WIDTH, HEIGHT, 80), ellipse(CENTRE, 39.0, OPENING, 80)
    teeth = inner - [0.0, 1.0] * (inner[:, 1:] > CENTRE[1]) * gap_px
    for ring, colour, blur in ((outer, LIP, 0.8), (inner, GAP, SOFT_PX), (teeth, TEETH, 0.8)):
        shape = np.zeros((240, 240), dtype=np.float32)
        cv2.fillPoly(shape, [np.rint(16 * (ring - 0.5)).astype(np.int32)], 1.0, cv2.LINE_AA, 4)
        share = cv2.GaussianBlur(shape, (0, 0), blur)[..., None]
        image = (1 - share) * image + share * np.array(colour, dtype=np.float32)
    landmarks = np.zeros((66, 2))
    landmarks[36], landmarks[45] = (20, 40), (220, 40)
    landmarks[48:66] = CENTRE
    landmarks[48], landmarks[54], landmarks[51], landmarks[57] = outer[[0, 40, 20, 60]]
    return srgb_to_linear(image), landmarks, (outer, inner)


@pytest.mark.parametrize("gap_px", [4.0, 5.0])
def test_a_lower_lip_begins_below_the_dark_under_the_teeth(gap_px):
    """Not above the lip's edge by more than 1 px, nor where the lip is as light as elsewhere."""
    image, landmarks, (outer, inner) = mouth(gap_px)
    found, _ = LandmarkRidgeDetector(reach=0.02).likelihood(image, landmarks, (outer, inner))
    column = found[:, int(CENTRE[0])].copy()
    column[: int(CENTRE[1])] = 0
    below_edge = column.argmax() + 0.5 - (CENTRE[1] + OPENING)
    assert -1.0 < below_edge < 1.2 * SOFT_PX
