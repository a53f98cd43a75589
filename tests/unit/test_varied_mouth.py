"""The actors of `python -m benchmarks mouths`: what a tongue hides, and how its border runs."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

from benchmarks.varied_mouth import PLACES, VariedMouth, varied_lighting, varied_look
from vermilion.faces.procedural import studio_model

OPEN = 3  # a frame whose jaw is open


@dataclass(frozen=True)
class OneExpression(VariedMouth):
    """The actor with an open jaw, and a tongue that stays in one of `PLACES`."""

    place: str

    @cached_property
    def weights(self):
        weights = np.zeros((self.n_frames, len(self.base.expression_names)))
        weights[OPEN, self.base.expression_names.index("jawOpen")] = 0.7
        return weights

    @cached_property
    def places(self):
        return np.tile(np.eye(len(PLACES))[PLACES.index(self.place)], (self.n_frames, 1))


def actor(head, place):
    return OneExpression(head, 2, OPEN + 1, place)


@pytest.fixture(scope="module")
def head():
    return studio_model(1.6, 4, 0)


@pytest.fixture(scope="module")
def borders(head):
    return {place: actor(head, place).borders_px(OPEN) for place in ("low", "raised", "out")}


def depth_of_border(lines, side):
    """Mean height (px, downwards) of the middle fifth of a border."""
    line = lines[side]
    share = (line[:, 0] - line[0, 0]) / (line[-1, 0] - line[0, 0])
    return line[(share > 0.4) & (share < 0.6), 1].mean()


@pytest.mark.slow
def test_a_tongue_that_hangs_out_hides_the_lower_lip(borders):
    low, out = borders["low"], borders["out"]
    assert depth_of_border(out, 1) > depth_of_border(low, 1) + 2.0
    assert abs(depth_of_border(out, 0) - depth_of_border(low, 0)) < 0.5


@pytest.mark.slow
def test_a_tongue_behind_the_lips_moves_no_border(borders):
    low, raised = borders["low"], borders["raised"]
    for side in (0, 1):
        assert depth_of_border(raised, side) == pytest.approx(depth_of_border(low, side), abs=0.5)


@pytest.mark.slow
def test_borders_run_from_the_right_corner_to_the_left(borders):
    for line in borders["low"]:
        assert line[0, 0] < line[len(line) // 2, 0] < line[-1, 0]


def test_a_tongue_stays_in_a_closed_mouth(head):
    closed = [actor(head, place)._tongue_mm(0) for place in ("low", "out")]
    np.testing.assert_array_equal(*closed)


def test_each_seed_has_its_mouth_and_its_light():
    looks = [varied_look(seed) for seed in range(8)]
    for name in ("teeth", "gums", "tongue", "wet"):
        values = np.array([np.sum(getattr(look, name)) for look in looks])
        assert len(np.unique(values)) == 8
    keys = {varied_lighting(seed).lights[0].centre_mm for seed in range(8)}
    assert len(keys) == 8
