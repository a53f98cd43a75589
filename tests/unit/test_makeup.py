"""Virtual make-up on a painted dome."""

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.image_fit_scene import CAMERA, LIGHT, dome, image_of, mesh_of, motion, paint
from vermilion.export.makeup import MakeUp, colour_of_hex, lip_outline, lipstick, star

MODEL = dome()


def with_lips():
    """The dome with lips: a circle of 15 mm in its middle."""
    turn = np.arange(32) * np.pi / 16
    wanted = 15 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    away = np.linalg.norm(MODEL.neutral_mm[:, None, :2] - wanted, axis=2)
    return replace(MODEL, outer_contour=away.argmin(axis=0).astype(np.int32))


def test_hex_colours_are_linear_light():
    assert colour_of_hex("#ffffff") == pytest.approx([1, 1, 1])
    assert colour_of_hex("#808080") == pytest.approx([0.2159] * 3, abs=1e-3)


def test_outline_lies_along_the_contour_and_is_positive_inside():
    model = with_lips()
    inside = lip_outline(model, model.neutral_mm)
    assert (
        np.abs(inside[model.outer_contour]).max() < 2.5
    )  # mm: half an edge, and what smoothing cuts
    radius = np.linalg.norm(model.neutral_mm[:, :2], axis=1)
    assert (inside[radius < 10] > 0).all() and (inside[radius > 18] < 0).all()


def test_star_has_five_tips():
    shape = star(np.zeros(3), 10.0, 0.0, "#ffffff", 1.0).inside
    turn = np.arange(5) * 2 * np.pi / 5
    for radius, turned, sign in ((9.5, 0.0, 1), (6.0, np.pi / 5, -1), (3.5, np.pi / 5, 1)):
        place = radius * np.stack([np.sin(turn + turned), np.cos(turn + turned)], axis=1)
        points = np.column_stack([place, np.full(5, 50.0)])
        assert (np.sign(shape(points)) == sign).all()


def test_lipstick_is_lit_as_the_skin_is_and_stays_on_the_lips():
    model, x = with_lips(), motion(1)[0]
    mesh = mesh_of(model, x)
    image = image_of(model, mesh)
    red = colour_of_hex("#9e0b2c")
    makeup = MakeUp(model, model.neutral_mm, LIGHT, paint(model), [lipstick("#9e0b2c", 1.0)])
    made_up, checked = makeup.draw(image, CAMERA, mesh)
    pixels = CAMERA.project(mesh)
    at = np.rint(pixels - 0.5).astype(int)
    inside = lip_outline(model, model.neutral_mm)
    column, row = at[inside > 3].T
    # Red, as bright as the light there makes it.
    drawn, skin = made_up[row, column], image[row, column]
    light = skin / paint(model)[inside > 3]
    assert np.median(np.abs(drawn / (red * light) - 1)) < 0.05
    far = (inside < -3) & (np.abs(model.neutral_mm[:, :2]).max(axis=1) < 50)
    column, row = at[far].T
    assert np.abs(made_up[row, column] - image[row, column]).max() < 1e-6
    assert np.abs(checked[row, column] - image[row, column]).mean() > 0.05
    assert made_up.shape == checked.shape == image.shape
