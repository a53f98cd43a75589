"""The opening that a camera sees on a mesh, and how it is held against drawn lips."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.lips_on_labels import COLUMNS, DrawnLips, compare, halves
from benchmarks.visible_opening import VisibleOpening
from tests.heads import small_tracker
from vermilion.geometry.camera import look_at, pinhole
from vermilion.storage.errors import InputError

#: Pixels a millimetre in the front view, nearly.
SCALE = 2000.0 / 600.0


@pytest.fixture(scope="module")
def model():
    return small_tracker()


def seen(model, vertices_mm, n=21):
    """(2, n, 2) px in a front view, between the corners of the mouth."""
    mouth = model.neutral_mm[model.outer_contour].mean(axis=0)
    front, up = 600.0 * np.eye(3)[2], np.eye(3)[1]
    camera = pinhole("cam", 2000.0, 800, 600, look_at(mouth + front, mouth, up))
    loop = camera.project(vertices_mm[model.inner_contour])
    ends = loop[loop[:, 0].argmin()], loop[loop[:, 0].argmax()]
    return VisibleOpening.of(model).borders(vertices_mm, camera, *ends, n)


def opened(model, weight):
    jaw = model.expressions_mm[model.expression_names.index("jawOpen")]
    return model.neutral_mm + weight * jaw


def test_a_lower_jaw_opens_the_mouth_by_the_lower_lip_alone(model):
    small, large = (seen(model, opened(model, weight)) for weight in (0.3, 0.6))
    moved = (large - small)[:, 7:14, 1]
    assert np.abs(moved[0]).max() < 1.0
    assert moved[1].min() > 5.0


def test_a_lip_that_rolls_over_the_line_where_lips_meet_is_the_border(model):
    """The line stays where it is; what is red hangs 3 mm over it."""
    vertices = opened(model, 0.5)
    rolled = vertices.copy()
    line = np.isin(np.arange(model.n_vertices), model.inner_contour)
    rolled[model.regions["vermilion_upper"] & ~line, 1] -= 3.0
    moved = (seen(model, rolled) - seen(model, vertices))[:, 7:14, 1] / SCALE
    assert 0.5 < np.median(moved[0]) < 3.2
    assert np.abs(moved[1]).max() < 0.1


def test_lips_that_cross_have_no_opening(model):
    vertices = opened(model, 0.0)
    vertices[model.regions["vermilion_upper"] | model.regions["mouth_inner"], 1] -= 4.0
    upper, lower = seen(model, vertices)
    np.testing.assert_allclose(upper, lower, atol=1e-9)


def borders(gap, shift=0.0):
    x = np.linspace(10.0, 110.0, COLUMNS)
    arch = gap * np.sin(np.linspace(0.1, np.pi - 0.1, COLUMNS))
    return np.stack([np.stack([x, 50 + shift - half * arch], axis=1) for half in (0.5, -0.5)])


def test_figures_of_borders_that_are_known():
    same = compare(borders(20.0), borders(20.0), 1.0)
    assert same["inner"] == pytest.approx(0.0, abs=1e-9)
    assert same["gap"] == pytest.approx(same["drawn"])
    lower = compare(borders(20.0, 3.0), borders(20.0), 2.0)
    assert lower["inner"] == pytest.approx(6.0, rel=0.05)  # at twice the size
    half = compare(borders(10.0), borders(20.0), 1.0)
    assert half["gap"] / half["drawn"] == pytest.approx(0.5)


def test_a_ring_is_cut_at_the_corners():
    angle = np.pi - np.linspace(0, 2 * np.pi, 80, endpoint=False)
    upper, lower = halves(np.stack([50 * np.cos(angle), -10 * np.sin(angle)], axis=1))
    assert upper[0, 0] == lower[0, 0] == pytest.approx(-50.0)
    assert upper[-1, 0] == lower[-1, 0] == pytest.approx(50.0)
    assert upper[20, 1] == pytest.approx(-10.0)
    assert lower[20, 1] == pytest.approx(10.0)


def test_a_file_that_is_no_label_is_named(tmp_path):
    path = tmp_path / "000003.json"
    path.write_text(json.dumps({"upper": [[0, 0], [1, 1]]}))
    with pytest.raises(InputError, match="000003"):
        DrawnLips.read(path)
