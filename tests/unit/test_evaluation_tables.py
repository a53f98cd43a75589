"""Table 1, the takes together, names of regressors, pieces of the page."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from vermilion.config.regressors import in_order, is_shown, is_variant, kind_of, measure_name
from vermilion.evaluation.contour_error import contour_error, distance_to_polyline
from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.files import load_sums, save_sums
from vermilion.evaluation.held_out import shown_rows
from vermilion.evaluation.measures import seconds_rows
from vermilion.evaluation.pooled import groups_of, pooled_rows
from vermilion.report.page import number, page, spans, table
from vermilion.report.table1 import table1

SECONDS = ["subject", "take", "regressor", "seconds_per_frame"]


def take(base, regressor, name):
    ones = np.ones(len(base))
    return {
        "base": ClipSums({"mouth.error": np.array(base), "mouth.weight": ones}),
        name: ClipSums({"mouth.error": np.array(regressor), "mouth.weight": ones}),
    }


def test_every_person_has_their_own_ps_in_the_pool():
    takes = [
        (take([2.0, 4.0], [1.0, 2.0], "PS-a"), 20),
        (take([6.0], [3.0], "PS-b"), 10),
        (take([8.0], [2.0], "oracle"), 5),
    ]
    rows = pooled_rows(takes, 200, 0.95, 0).set_index(["measure", "regressor"])
    assert rows.loc[("vertex_error_mean_mm", "PS"), "value"] == 2.0
    assert rows.loc[("vertex_error_mean_mm", "base"), "value"] == 5.0
    assert rows.loc[("ratio_to_base", "PS"), "value"] == 0.5
    assert rows.loc[("vertex_error_mean_mm", "PS"), "frames"] == 30
    # The oracle is held against the base of its own take alone.
    assert rows.loc[("ratio_to_base", "oracle"), "value"] == 0.25


def test_takes_of_several_roles_are_also_joined_by_role():
    assert groups_of(["video", "video"]) == {"all": [0, 1]}
    assert groups_of(["tattoo", "video", "tattoo"]) == {"all": [0, 1, 2], "tattoo": [0, 2]}


def test_seconds_of_all_takes_are_the_mean_over_frames():
    one = pd.DataFrame([("s1", "rom", "PS-s1", 0.001)], columns=SECONDS)
    two = pd.DataFrame([("s2", "rom", "PS-s2", 0.003)], columns=SECONDS)
    rows = seconds_rows([one, two], {"s1/rom": 30, "s2/rom": 10})
    assert rows["regressor"].tolist() == ["PS", "PS-s1", "PS-s2"]
    assert rows["value"].tolist() == [0.0015, 0.001, 0.003]
    assert rows["frames"].tolist() == [40, 30, 10]


def test_table1_has_the_papers_order_and_the_pool_first():
    columns = [
        "measure",
        "region",
        "subject",
        "take",
        "regressor",
        "value",
        "unit",
        "low",
        "high",
        "frames",
    ]
    rows = [
        (m, "mouth", s, t, r, v, "mm", np.nan, np.nan, 9)
        for s, t in (("s1", "rom"), ("all", "all"))
        for r in ("GR-s1", "MS/affine", "MS", "PS-s1", "oracle", "base")
        for m, v in (("vertex_error_mean_mm", 1.0), ("vertex_error_std_mm", 0.3), ("ratio_to_base", 0.7))
    ]  # fmt: skip
    found = table1(pd.DataFrame(rows, columns=columns))
    assert found["subject"].tolist() == ["all"] * 6 + ["s1"] * 6
    order = ["base", "oracle", "PS-s1", "MS", "GR-s1", "MS/affine"]
    assert found["regressor"].tolist() == 2 * order
    assert found.loc[0, "ratio_to_base"] == 1.0


@pytest.mark.parametrize(
    ("stem", "name", "kind"),
    [
        ("MS", "MS", "MS"),
        ("PS-s1-affine", "PS-s1/affine", "PS/affine"),
        ("GR-an-na-shape-only", "GR-an-na/shape-only", "GR/shape-only"),
    ],
)
def test_names_of_regressors(stem, name, kind):
    assert measure_name(stem) == name
    assert kind_of(name) == kind
    assert in_order([name, "base"]) == ["base", name]


def test_every_table_has_what_learnt_nothing_and_the_paper_to_the_letter():
    names = [
        "MS/rbf",
        "PS/paper",
        "PS/neutral",
        "PS",
        "null/neutral",
        "null",
        "base/neutral",
        "base",
    ]
    assert in_order(names) == names[::-1][:2] + names[::-1][2:4] + [
        "PS",
        "PS/neutral",
        "PS/paper",
        "MS/rbf",
    ]
    assert [name for name in names if is_variant(name)] == ["MS/rbf"]
    assert [name for name in names if is_shown(name)] == ["PS/neutral", "PS", "null", "base"]


def test_sums_survive_their_file(tmp_path):
    sums = take([2.0, 4.0], [1.0, 2.0], "MS/affine")
    save_sums(tmp_path / "s.npz", sums, 17)
    read, frames = load_sums(tmp_path / "s.npz")
    assert frames == 17
    assert set(read) == {"base", "MS/affine"}
    assert (read["MS/affine"].sums["mouth.error"] == [1.0, 2.0]).all()


def test_distance_to_a_polyline():
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    points = np.array([[5.0, -3.0], [-3.0, -4.0], [-2.0, 5.0]])
    assert np.allclose(distance_to_polyline(points, square, closed=True), [3.0, 5.0, 2.0])
    open_distance = distance_to_polyline(points, square, closed=False)
    assert open_distance[2] == pytest.approx(np.hypot(2, 5))


def test_contour_error_is_per_interocular_distance():
    from vermilion.geometry.camera import pinhole

    camera = pinhole("c", 1000.0, 640, 480)
    square = np.array([[-20.0, -20, 500], [20, -20, 500], [20, 20, 500], [-20, 20, 500]])
    found = camera.project(square)[None] + [[[0.0, 4.0]]]
    error = contour_error(
        square[None], camera, np.arange(4), None, found, found, interocular_px=np.array([80.0])
    )
    assert error[0] == pytest.approx(4.0 / 80.0 / 2, abs=1e-6)  # two corners slide along the sides
    nothing = np.full((1, 4, 2), np.nan)
    assert np.isnan(
        contour_error(square[None], camera, np.arange(4), None, nothing, nothing, np.ones(1))
    )


def test_frames_of_error_maps_are_the_worst_of_equal_stretches():
    error = np.array([1.0, 3, 2, 9, 1, 1, np.nan, 4, 5])
    assert shown_rows(error, 3).tolist() == [1, 3, 8]
    assert shown_rows(error[:2], 5).tolist() == [0, 1]


def test_page_escapes_what_people_typed():
    rows = pd.DataFrame({"reason": ["<b>bad</b> & worse"], "frames": [3]})
    html = page("T", "lead", [("A", table(rows, {"reason": "why", "frames": "n"})), ("B", "")])
    assert "&lt;b&gt;bad&lt;/b&gt; &amp; worse" in html
    assert ">B</h2>" not in html


def test_numbers_and_spans_as_people_read_them():
    assert number(0.00203) == "0.002"
    assert number(float("nan")) == ""
    assert number(3.14159) == "3.14"
    assert spans([5, 3, 4, 9, 9]) == "3-5, 9"
