"""Flagged frames by the kind of their reason."""

from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.report.lips_page import frames_with_warnings
from vermilion.report.reason_kinds import REMEDIES, by_kind, shortened_spans

PROJECT = Path(__file__).parents[2]
GUIDE = PROJECT / "docs" / "howto" / "bad_take.md"


def rows(*items):
    return pd.DataFrame(items, columns=["stage", "frame", "valid", "reason"])


def test_figures_that_differ_make_no_row_of_their_own():
    found = by_kind(
        rows(
            ("apply", 0, 1, "inner edge 1.3 times as rough as the base track's"),
            ("apply", 1, 1, "inner edge 17.1 times as rough as the base track's"),
            ("apply", 9, 1, "inner edge 2.0 times as rough as the base track's"),
            ("tracking", 9, 0, "landmarks miss the model by 20.0 px"),
        )
    )
    first, second = found
    assert first.reason == "inner edge 1.3 to 17.1 times as rough as the base track's"
    assert (first.count, first.which, first.state) == (3, "0-1, 9", "warning")
    assert "mouth" in first.remedy
    assert second.reason == "landmarks miss the model by 20.0 px"
    assert (second.stage, second.state) == ("tracking", "not usable")


def test_a_reason_of_two_faults_counts_for_both():
    both = "3 lip triangles flipped or folded; inner edge 2.0 times as rough as the base track's"
    found = by_kind(rows(("apply", 4, 1, both), ("apply", 5, 1, both.partition("; ")[2])))
    assert [(kind.count, kind.which) for kind in found] == [(1, "4"), (2, "4-5")]


def test_a_sentence_with_what_was_expected_stays_whole():
    error = "found a; expected b. Mend it."
    (kind,) = by_kind(rows(("capture", 1, 0, error), ("capture", 2, 0, error)))
    assert kind.reason == error and kind.count == 2


def test_a_row_without_a_reason_is_a_row():
    (kind,) = by_kind(rows(("run", 1, 0, np.nan)))
    assert kind.reason == "" and kind.remedy == ""


def test_many_ranges_are_shortened():
    assert shortened_spans([1, 2, 3, 7]) == "1-3, 7"
    assert shortened_spans(range(0, 200, 2)).endswith("46 and 76 more ranges")


def test_frames_are_counted_once_and_unusable_ones_apart():
    table = rows(("a", 1, 1, "x"), ("b", 1, 1, "y"), ("a", 2, 0, "z"), ("b", 2, 1, "y"))
    assert frames_with_warnings(table, 9) == "1 of 9 frames has a warning, 1 is not usable."
    assert frames_with_warnings(rows(), 9) == "0 of 9 frames have warnings."


def test_the_guide_explains_each_kind_of_reason():
    guide = GUIDE.read_text(encoding="utf-8")
    assert [said for said, _ in REMEDIES if said not in guide] == []


def test_each_kind_of_reason_is_said_somewhere():
    sources = "".join(
        path.read_text(encoding="utf-8")
        for folder in ("src", "workflow")
        for path in (PROJECT / folder).rglob("*.py")
        if path.name != "reason_kinds.py"
    )
    assert [said for said, _ in REMEDIES if said not in sources] == []
