"""Kinds of mouth shapes, told by curves and by shape alike, and errors by kind."""

from __future__ import annotations

import numpy as np
import pytest

from tests.heads import small_studio
from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.kind_errors import kind_rows, sums_of_kinds
from vermilion.evaluation.masks import Regions
from vermilion.evaluation.mouth_kinds import KINDS, kinds_of_curves, kinds_of_shapes

POSES = {
    "kiss": {"mouthPucker": 0.6, "jawOpen": 0.05},
    "roll": {"mouthRollLower": 0.7, "mouthRollUpper": 0.7, "jawOpen": 0.06},
    "press": {"mouthPress_L": 0.7, "mouthPress_R": 0.7},
    "open": {"jawOpen": 0.5},
    "smile": {"mouthSmile_L": 0.8, "mouthSmile_R": 0.8},
    "speech": {"jawOpen": 0.15, "mouthSmile_L": 0.1, "mouthPucker": 0.1},
}


@pytest.mark.parametrize("kind", KINDS)
def test_curves_and_shapes_tell_the_same_kind(kind):
    model = small_studio()

    def mesh(curves):
        weights = [curves.get(name, 0.0) for name in model.expression_names]
        return model.vertices(None, np.array(weights))

    assert kinds_of_curves([POSES[kind]]).tolist() == [kind]
    everywhere = np.ones(model.n_vertices, dtype=bool)
    found = kinds_of_shapes(mesh(POSES[kind])[None], mesh({"jawOpen": 0.08}), model, everywhere)
    assert found.tolist() == [kind]


def test_error_of_a_kind_is_that_of_its_frames_alone():
    kinds = np.array(["kiss", "kiss", "open", "speech"])
    clips = np.array([0, 0, 1, 1])
    area = np.array([1.0, 3.0])
    regions = Regions({"mouth": area, "vermilion": area}, np.zeros(2))
    errors = np.array([[2.0, 2.0], [4.0, 4.0], [1.0, 5.0], [7.0, 7.0]])
    takes = [
        (
            {
                "base": sums_of_kinds(errors, kinds, regions, clips),
                "PS-s": sums_of_kinds(errors / 2, kinds, regions, clips),
            },
            4,
        )
    ]
    rows = (
        kind_rows(takes, 100, 0.95, 0).query("region == 'mouth'").set_index(["kind", "regressor"])
    )
    assert set(rows.index.get_level_values("kind")) == {"kiss", "open", "speech"}
    assert rows.loc[("kiss", "base"), "mean_mm"] == 3.0
    assert rows.loc[("open", "base"), "mean_mm"] == 4.0
    assert rows.loc[("open", "PS"), "ratio_to_base"] == 0.5
    assert rows.loc[("kiss", "PS"), ["frames", "clips"]].tolist() == [2, 1]
    assert np.isnan(rows.loc[("kiss", "PS"), "low_mm"])  # one clip has no interval


def test_takes_without_a_kind_are_joined_with_those_that_have_it():
    regions = Regions({"mouth": np.ones(1), "vermilion": np.ones(1)}, np.zeros(1))

    def take(kind, error):
        sums = sums_of_kinds(np.full((2, 1), error), np.array([kind] * 2), regions, np.arange(2))
        return {"base": sums + ClipSums()}, 2

    rows = kind_rows([take("kiss", 1.0), take("smile", 3.0)], 100, 0.95, 0)
    means = rows.query("region == 'mouth'").set_index("kind")["mean_mm"]
    assert means.to_dict() == {"kiss": 1.0, "smile": 3.0}
