"""A contour that neither the landmarks nor the track know of is not followed."""

import numpy as np
import pytest

from tests.unit.mouths import ellipse
from vermilion.features.contradiction import contradiction, ring_distance

CENTRE, UNIT = (120.0, 150.0), 200.0


def mouth(lower=0.0, height=8.0):
    return ellipse((CENTRE[0], CENTRE[1] + lower), 40.0, height, 80)


def test_distance_of_rings_is_theirs_whichever_is_first():
    assert ring_distance(mouth(), mouth()) == pytest.approx(0.0, abs=1e-9)
    one, other = ring_distance(mouth(), mouth(9.0)), ring_distance(mouth(9.0), mouth())
    assert one == pytest.approx(other)
    assert 4.0 < one < 9.0


def test_a_contour_is_believed_near_either_and_by_nobody_else():
    found, far = mouth(), mouth(40.0)
    assert contradiction(found, (mouth(4.0), far), UNIT, 0.05) == ""
    assert contradiction(found, (far, mouth(4.0)), UNIT, 0.05) == ""
    assert "not followed" in contradiction(found, (far, far), UNIT, 0.05)
    assert "not followed" in contradiction(found, (None, far), UNIT, 0.05)


def test_a_face_without_landmarks_and_track_says_nothing_against_a_contour():
    unknown = np.full((80, 2), np.nan)
    assert contradiction(mouth(), (None, unknown), UNIT, 0.05) == ""
