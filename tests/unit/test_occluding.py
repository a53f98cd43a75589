"""What hides the mouth: the inner contour in the image moves over the lips as they roll."""

import numpy as np
import pytest

from tests.heads import small_tracker
from vermilion.faces.lips import lip_sides
from vermilion.features.occluding import OccludingContour
from vermilion.features.rings import lip_rings
from vermilion.geometry.camera import look_at, pinhole


@pytest.fixture(scope="module")
def model():
    return small_tracker()


def seen(model, vertices_mm):
    """(pixels of the contour, sides, the points themselves (n, 3)) in a front view."""
    mouth = model.neutral_mm[model.outer_contour].mean(axis=0)
    front, up = 600.0 * np.eye(3)[2], np.eye(3)[1]
    camera = pinhole("cam", 2000.0, 800, 600, look_at(mouth + front, mouth, up))
    occluding = OccludingContour.of(model)
    outer, inner = (camera.project(ring.points(vertices_mm)) for ring in lip_rings(model, 80))
    pixels = camera.project(occluding.on(vertices_mm))
    _, points, above = occluding.match(pixels, outer, inner, np.ones(80, dtype=bool))
    assert above @ [0.0, -1.0] > 0.99  # pixels count downwards
    return pixels[points], occluding.sides[points], occluding.on(vertices_mm)[points]


def opened(model):
    jaw = model.expressions_mm[model.expression_names.index("jawOpen")]
    return model.neutral_mm + 0.5 * jaw


def test_no_point_of_a_lip_hangs_over_the_contour(model):
    vertices = opened(model)
    sides = lip_sides(model, with_inside=True)
    _, side, points = seen(model, vertices)
    assert len(points) > 50
    for lip, sign in ((1, 1.0), (-1, -1.0)):
        edge, all_of_lip = points[side == lip], vertices[sides == lip]
        height = np.interp(all_of_lip[:, 0], *edge[np.argsort(edge[:, 0])][:, :2].T)
        inside = np.abs(all_of_lip[:, 0]) < 0.8 * np.abs(edge[:, 0]).max()
        assert (sign * (all_of_lip[:, 1] - height))[inside].min() > -0.5


def test_a_lip_that_rolls_over_its_line_hides_more_of_the_mouth(model):
    """The line where the lips meet in the neutral stays, and what is red hangs over it."""
    vertices = opened(model)
    rolled = vertices.copy()
    line = np.zeros(model.n_vertices, dtype=bool)
    line[model.inner_contour] = True
    rolled[model.regions["vermilion_upper"] & ~line, 1] -= 3.0
    before, side_before, _ = seen(model, vertices)
    after, side_after, _ = seen(model, rolled)
    for lip, moved in ((1, True), (-1, False)):
        change = np.median(after[side_after == lip, 1]) - np.median(before[side_before == lip, 1])
        assert (change > 1.0) == moved


def test_contours_that_were_not_found_match_nothing(model):
    occluding = OccludingContour.of(model)
    nothing = np.full((80, 2), np.nan)
    pixels = np.zeros((len(occluding.points), 2))
    samples, points, _ = occluding.match(pixels, np.zeros((80, 2)), nothing, np.zeros(80, bool))
    assert len(samples) == len(points) == 0
