"""What tells lips from skin, on drawn lips that pale towards their border."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.mouths import LIP, SKIN, ellipse
from vermilion.contours.lip_planes import lip_planes

SIZE, CENTRE = 220, (110.0, 110.0)
HALF_WIDTH, HALF_HEIGHT = 60.0, 30.0


def pale_lips(share):
    """Colours (3, size, size): lips pale over their outer half, then `share` of the step to skin."""
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    out = np.hypot((x - CENTRE[0]) / HALF_WIDTH, (y - CENTRE[1]) / HALF_HEIGHT)
    paleness = np.where(out < 1, (1 - share) * np.clip(2 * out - 1, 0, 1), 1.0)
    noise = 0.004 * np.random.default_rng(0).standard_normal((3, SIZE, SIZE))
    lip, skin = (np.array(colour)[:, None, None] for colour in (LIP, SKIN))
    return (lip + paleness * (skin - lip) + noise).astype(np.float32)


def border_px(plane):
    """Where along the middle column, from the centre down, the plane falls below a half."""
    column = plane[round(CENTRE[1]) :, round(CENTRE[0])]
    return float(np.flatnonzero(column < 0.5)[0])


@pytest.mark.parametrize("off_px", [-2.0, 0.0, 2.0])
def test_lips_that_pale_end_at_the_step_and_not_where_they_are_half_pale(off_px):
    curves = {
        "outer": ellipse(CENTRE, HALF_WIDTH + off_px, HALF_HEIGHT + off_px, 240),
        "inner": ellipse(CENTRE, 0.6 * HALF_WIDTH, 3.0, 240),
    }
    colours = pale_lips(0.25)
    far, beside = (
        border_px(lip_planes(colours, curves, (0.5, 0.95), 50.0, beside=choice)["outer"])
        for choice in (False, True)
    )
    assert far < HALF_HEIGHT - 3.0
    assert beside == pytest.approx(HALF_HEIGHT, abs=1.0)


def test_without_the_outer_plane_the_others_are_the_same():
    curves = {
        "outer": ellipse(CENTRE, HALF_WIDTH, HALF_HEIGHT, 240),
        "inner": ellipse(CENTRE, 0.6 * HALF_WIDTH, 3.0, 240),
    }
    asked = pale_lips(0.25), curves, (0.5, 0.95), 50.0
    planes, inside = lip_planes(*asked), lip_planes(*asked, outer=False)
    assert set(planes) - set(inside) == {"outer"}
    for name, plane in inside.items():
        np.testing.assert_array_equal(plane, planes[name])
