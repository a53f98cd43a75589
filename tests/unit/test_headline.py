"""The headline: what a reader sees first, composed from measures and comparisons."""

from __future__ import annotations

import numpy as np
import pandas as pd

from vermilion.app.results import summary
from vermilion.report.headline import closing_table, headline, learning_sentences
from vermilion.storage.tables import write_table

VALUES = {"base": 1.5, "null": 1.3, "null/neutral": 1.2, "PS": 0.6, "GR": 1.3, "MS/rbf": 0.7}


def measures():
    rows = [
        (m, region, "all", "all", name, value, "mm", np.nan, np.nan, 30)
        for name, value in VALUES.items()
        for m, region in (("lip_motion_error_mm", "vermilion"), ("vertex_error_mean_mm", "mouth"))
    ]
    return pd.DataFrame(rows, columns=[
        "measure", "region", "subject", "take", "regressor", "value", "unit", "low", "high", "frames",
    ])  # fmt: skip


def comparisons():
    rows = [
        ("lip_motion_error_mm", "PS", "null/neutral", 0.6, 1.2, 0.5, "better"),
        ("lip_motion_error_mm", "PS", "null", 0.6, 1.3, 0.46, "better"),
        ("vertex_error_mean_mm", "PS", "null/neutral", 1.0, 0.9, 1.11, "worse"),
        ("lip_motion_error_mm", "GR", "null", 1.3, 1.3, 1.0, "level"),
    ]
    return pd.DataFrame(rows, columns=[
        "measure", "first", "second", "first_value", "second_value", "ratio", "answer",
    ])  # fmt: skip


def test_a_regressor_is_held_against_the_null_that_was_told_as_much():
    table = headline(measures(), comparisons()).set_index("regressor")
    assert table.index.tolist() == ["base", "null", "null/neutral", "PS", "GR"]
    assert table.loc["PS", ["null", "over_null"]].tolist() == ["null/neutral", 0.5]
    assert table.loc["GR", ["null", "over_null", "answer"]].tolist() == ["null", 1.0, "level"]
    assert np.isnan(table.loc["base", "over_null"])


def test_sentences_name_the_measure_on_which_learning_helps_and_that_on_which_it_does_not():
    found = learning_sentences(headline(measures(), comparisons()), comparisons())
    assert found == [
        "PS: of the lips' motion 50 % less is wrong (0.60 for 1.20 mm: better); of the vertex error over the "
        "mouth 11 % more is wrong (1.00 for 0.90 mm: worse), against null/neutral.",
        "GR: of the lips' motion 0 % less is wrong (1.30 for 1.30 mm: not shown to differ), against null.",
    ]  # fmt: skip


def test_a_run_closes_with_the_motion_of_the_lips(tmp_path):
    table = headline(measures(), comparisons())
    write_table(tmp_path / "evaluation/headline.tsv", table)
    lines = "\n".join(summary(tmp_path))
    assert closing_table(table) in lines
    assert lines.index("lip motion") < lines.index("opening") < lines.index("vertices")
