"""Mouths that show gums: the lip ends at the crease before them, not where teeth begin."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.mouths import draw_mouth
from vermilion.contours import ridges
from vermilion.contours.gums import creases, flesh_plane
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.imaging.images import srgb_to_linear

CENTRE, OPENING, WIDTH = (120.0, 150.0), 22.0, 39.0
GUM, TEETH = np.array([0.62, 0.38, 0.37]), np.array([0.86, 0.84, 0.80])  # sRGB
STRIP_PX = 12.0  # of gum below the upper lip


def draw_teeth(gums: bool):
    """(image, landmarks, upper border of the opening (n, 2)) of a wide open mouth.

    Teeth hang from the upper lip, or from gums that come out of the lip's shade.
    """
    image, landmarks, label = draw_mouth(OPENING, 40.0, centre=CENTRE, noise=0.005)
    y, x = np.mgrid[0:240, 0:240] + 0.5
    across, down = (x - CENTRE[0]) / WIDTH, y - CENTRE[1]
    top = -OPENING * np.sqrt(np.clip(1 - across**2, 0.0, 1.0))
    below = down - top  # of the upper lip's border
    inside = (np.abs(across) < 0.95) & (below > 0) & (np.hypot(across, down / OPENING) < 1)
    strip = STRIP_PX * np.sqrt(np.clip(1 - across**2, 0.0, 1.0)) if gums else 0.0
    image[inside & (below < 26)] = srgb_to_linear(TEETH)
    image[inside & (below < strip)] = srgb_to_linear(GUM)
    if gums:
        shade = 1 - 0.8 * np.exp(-0.5 * (below / 4.0) ** 2) * (np.abs(across) < 0.95)
        image *= np.where(down < 0, shade, 1.0)[..., None]
    upper = label.inner.dense(1.0)
    upper = upper[(upper[:, 1] < CENTRE[1]) & (np.abs(upper[:, 0] - CENTRE[0]) < 0.7 * WIDTH)]
    return image.astype(np.float32), landmarks, upper


def crest_below_border_px(likelihood, border, reach=18):
    """Mean height of the strongest pixel of a map below a border, and mean distance from it."""
    columns = np.floor(border[:, 0]).astype(int)
    rows = np.floor(border[:, 1]).astype(int)[:, None] + np.arange(-reach, reach + 1)
    strongest = likelihood[rows, columns[:, None]].argmax(axis=1)
    below = rows[np.arange(len(rows)), strongest] + 0.5 - border[:, 1]
    return below.mean(), np.abs(below).mean()


@pytest.mark.parametrize("lower_px", [0.0, 6.0])
@pytest.mark.parametrize("gums", [True, False])
def test_the_upper_lip_ends_where_teeth_or_gums_begin(gums, lower_px):
    image, landmarks, border = draw_teeth(gums)
    landmarks[[59, 60, 61], 1] += lower_px  # as networks take gums for lip
    inner, _ = LandmarkRidgeDetector().likelihood(image, landmarks)
    offset, distance = crest_below_border_px(inner, border)
    assert abs(offset) < 1.5
    assert distance < 2.0


@pytest.mark.parametrize("opening", [0.7, 8.0, 22.0])
def test_nothing_changes_without_gums(opening, monkeypatch):
    image, landmarks, _ = draw_mouth(opening, 40.0, seed=3)
    if opening > 20:
        image, landmarks, _ = draw_teeth(gums=False)
    found = LandmarkRidgeDetector().likelihood(image, landmarks)
    monkeypatch.setattr(ridges, "creases", lambda lightness, *_: (np.zeros(lightness.shape),) * 2)
    without = LandmarkRidgeDetector().likelihood(image, landmarks)
    # but for the mouth's corners, where lips touch
    changed = np.abs(np.subtract(found, without))[:, :, 90:150]
    assert changed.max() < 0.1


def test_the_line_of_a_closed_mouth_is_not_gums():
    image, landmarks, _ = draw_mouth(0.7, 22.0, seed=4)
    inner, _ = LandmarkRidgeDetector().likelihood(image, landmarks)
    middle = inner[:, 100:141]
    np.testing.assert_allclose(middle.argmax(axis=0) + 0.5, 150.0, atol=1.5)


def lines(values):
    return np.array([values], dtype=np.float64)


def test_a_crease_has_flesh_on_both_sides():
    # outwards: teeth, gum, crease, lip
    lightness = lines([0.7] * 10 + [0.4] * 10 + [0.35, 0.3, 0.2, 0.3, 0.35] + [0.45] * 15)
    flesh = lines([0] * 10 + [1] * 30) > 0
    lip = lines([0] * 20 + [1] * 20) > 0
    line, beyond = creases(lightness, flesh, lip, 1.0)
    assert line[0].argmax() == 22
    assert line.max() == pytest.approx(1.0)
    assert (beyond[0, :15] > 0.95).all()
    assert (beyond[0, 22:] == 0).all()


@pytest.mark.parametrize("beside", [0.7, 0.02])
def test_shade_beside_teeth_or_the_dark_is_no_crease(beside):
    lightness = lines([beside] * 20 + [0.2, 0.25, 0.3, 0.35, 0.4] + [0.45] * 15)
    flesh = lines([0] * 20 + [1] * 20) > 0
    line, beyond = creases(lightness, flesh, flesh, 1.0)
    assert line.max() == beyond.max() == 0


def test_a_line_that_meets_no_lip_has_no_crease():
    lightness, nowhere = np.full((3, 40), 0.4), np.zeros((3, 40), dtype=bool)
    line, beyond = creases(lightness, ~nowhere, nowhere, 0.5)
    assert line.max() == beyond.max() == 0


def test_flesh_is_known_in_shade_but_not_in_black_or_grey():
    lip = np.array([0.45, 0.68, 0.6])
    shaded = np.array([0.2, 0.58, 0.54])
    teeth, black = np.array([0.7, 0.51, 0.55]), np.array([0.03, 0.51, 0.5])
    colours = np.stack([lip, lip, shaded, teeth, black], axis=1)[:, None].astype(np.float32)
    where = np.array([[True, True, False, False, False]])
    np.testing.assert_array_equal(flesh_plane(colours, where), [[1, 1, 1, 0, 0]])
    colours[1:] = 0.5
    assert flesh_plane(colours, where).max() == 0
