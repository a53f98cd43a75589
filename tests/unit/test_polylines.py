"""Points along a polyline lie at the asked lengths."""

import numpy as np
import pytest

from vermilion.geometry.polylines import evenly_along, lengths_along, points_at

CORNER = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])


def test_lengths_are_those_of_the_segments():
    assert lengths_along(CORNER).tolist() == [0.0, 3.0, 7.0]


def test_a_length_inside_a_segment_is_a_point_of_it():
    assert points_at(CORNER, np.array([1.5, 5.0])).tolist() == [[1.5, 0.0], [3.0, 2.0]]


def test_even_points_begin_and_end_with_the_line_in_any_dimension():
    rng = np.random.default_rng(0)
    line = rng.normal(size=(6, 3)).cumsum(axis=0)
    even = evenly_along(line, 400)
    assert np.allclose(even[[0, -1]], line[[0, -1]])
    steps = np.linalg.norm(np.diff(even, axis=0), axis=1)
    assert steps.max() == pytest.approx(lengths_along(line)[-1] / 399)
    assert steps.sum() == pytest.approx(lengths_along(line)[-1], rel=0.01)
