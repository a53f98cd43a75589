"""Comparisons of regressors, tables 2 and 3, and the sentences that the report makes of them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from vermilion.evaluation.comparisons import comparisons, questions_of, rbf_and_affine
from vermilion.evaluation.errors import ClipSums
from vermilion.report.feature_tables import estimators, table2, table3
from vermilion.report.statements import sentence, statements

CLIPS = 12


def sums(errors, layers=None):
    ones = np.ones(len(errors))
    found = {"mouth.error": np.array(errors), "mouth.weight": ones}
    found |= {"vermilion.motion": np.array(errors), "vermilion.motion_weight": ones}
    if layers is not None:
        found["mouth.feature_square"] = np.array(layers) ** 2
        found["mouth.feature_entries"] = np.ones(len(layers))
    return ClipSums(found)


def compared(first, second, layers=(None, None)):
    take = {"MS/rbf": sums(first, layers[0]), "MS/affine": sums(second, layers[1])}
    rows = comparisons([(take, 100)], questions_of("kernel"), 500, 0.95, 0)
    return rows.set_index("measure").loc["vertex_error_mean_mm"]


def test_what_is_hard_for_both_does_not_hide_a_difference():
    """Clips differ by millimetres, the regressors by 0.1 mm in each: unpaired intervals overlap."""
    hard = np.random.default_rng(0).uniform(1.0, 5.0, CLIPS)
    row = compared(hard, hard + 0.1 + 0.01 * np.arange(CLIPS))
    assert row["answer"] == "better"
    assert row["difference"] == pytest.approx(-0.155, abs=1e-9)
    assert row["low"] < row["difference"] < row["high"] < 0


@pytest.mark.parametrize(("shift", "answer"), [(-0.2, "worse"), (0.0, "level"), (0.2, "better")])
def test_answers_follow_the_interval(shift, answer):
    noise = 0.1 * np.random.default_rng(1).normal(size=CLIPS)
    row = compared(np.full(CLIPS, 2.0), 2.0 + shift + noise - noise.mean())
    assert row["answer"] == answer


def test_one_clip_gives_no_answer():
    row = compared([1.0], [2.0])
    assert row["answer"] == "unknown"
    assert np.isnan(row["low"])


def test_only_takes_with_both_are_compared_and_each_persons_own_are_joined():
    takes = [
        ({"GR-a": sums([1.0]), "GR-a/rbf": sums([2.0])}, 10),
        ({"GR-b": sums([3.0]), "GR-b/rbf": sums([4.0])}, 20),
        ({"GR-c": sums([100.0])}, 30),
    ]
    rows = comparisons(takes, questions_of("kernel"), 100, 0.95, 0)
    row = rows[rows["second"] == "GR/rbf"].iloc[0]
    assert (row["first"], row["frames"], row["clips"]) == ("GR", 30, 2)
    assert row["first_value"] == 2.0


def test_the_configured_estimator_has_no_variant_of_its_name():
    assert rbf_and_affine("kernel")[0] == ("MS/rbf", "MS/affine")
    assert rbf_and_affine("rbf")[0] == ("MS", "MS/affine")


def curve(name, error, alpha=0.1, beta=0.3, frames=30):
    row = {
        "regressor": name, "alpha": alpha, "beta": beta, "feature_error": error,
        "feature_error_se": 0.01, "folds": 4, "frames": frames, "freedom": 3.0, "chosen": 1,
    }  # fmt: skip
    return pd.DataFrame([row | {"chosen": 0, "feature_error": 9.0}, row])


CURVES = [
    curve("MS", 0.13), curve("MS-shape-only", 0.14), curve("MS-distances-only", 0.17),
    curve("MS-rbf", 0.135), curve("MS-affine", 0.136, beta=np.nan),
    curve("GR-an-na", 0.2, frames=10), curve("GR-bo", 0.4, frames=30),
]  # fmt: skip


def tracked(values):
    rows = [
        {"subject": "all", "take": "all", "regressor": name, "mean_mm": value, "low_mm": value - 0.1,
         "high_mm": value + 0.1, "std_mm": 1.0, "ratio_to_base": value / 4, "frames": 90}
        for name, value in values.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


TABLE1 = tracked(
    {"base": 4.0, "oracle": 1.0, "MS": 3.0, "MS/shape-only": 3.2, "MS/distances-only": 3.3,
     "MS/rbf": 3.1, "MS/affine": 3.1, "GR": 3.4, "null": 3.9}
)  # fmt: skip
MEASURES = pd.DataFrame([
    {"measure": "feature_error", "region": "mouth", "subject": "all", "take": take,
     "regressor": name, "value": value, "frames": 90}
    for take, name, value in (("all", "null", 0.3), ("rom", "null", 0.9), ("all", "MS", 0.1))
])  # fmt: skip


def test_tables_of_the_paper():
    errors = table2(CURVES, MEASURES).set_index(["regressor", "features"])["feature_error"]
    assert errors["MS"].to_dict() == {
        "shape coefficients": 0.14, "contour distances": 0.17, "combined": 0.13,
    }  # fmt: skip
    # Of GR, one regressor a person: root mean square over all frames.
    assert errors["GR", "combined"] == pytest.approx(np.sqrt((10 * 0.04 + 30 * 0.16) / 40))
    rows = table3(TABLE1).set_index("features")
    assert rows["mean_mm"].to_dict() == {
        "shape coefficients": 3.2, "contour distances": 3.3, "combined": 3.0, "none": 3.9,
    }  # fmt: skip
    # GR has no variants to be held against.
    assert rows["regressor"].tolist() == ["MS", "MS", "MS", "null"]
    best = estimators(CURVES, MEASURES, TABLE1, "kernel").set_index(["regressor", "estimator"])
    assert best.loc[("MS", "rbf"), ["alpha", "beta", "mean_mm"]].tolist() == [0.1, 0.3, 3.1]
    assert np.isnan(best.loc[("MS", "affine"), "beta"])
    assert best.loc[("MS", "kernel"), "feature_error"] == 0.13
    # What has learnt nothing stands in each of them: its error on held-out frames of all takes.
    assert errors["null", "none"] == 0.3
    assert best.loc[("null", "none"), ["feature_error", "mean_mm"]].tolist() == [0.3, 3.9]


def test_sentences_say_what_the_figures_say():
    hard = np.linspace(1.0, 5.0, CLIPS)
    better = sentence(compared(0.8 * hard, hard).to_dict())
    assert "20 % less" in better and "better, and the interval leaves out 0" in better
    level = compared(hard, hard[::-1].copy())
    assert "not shown to differ" in sentence(level.to_dict())


def test_sentences_tell_the_motion_from_the_person():
    """Twice the error, all of it in the person: the motion is as good."""
    errors = np.linspace(1.0, 2.0, CLIPS)
    motion = {"vermilion.motion": errors, "vermilion.motion_weight": np.ones(CLIPS)}
    take = {
        name: ClipSums({**sums(total).sums, **motion})
        for name, total in (("MS/rbf", 2 * errors), ("MS/affine", errors))
    }
    rows = comparisons([(take, 100)], questions_of("kernel"), 200, 0.95, 0)
    (_, sentences), *_ = statements(
        rows, estimators(CURVES, MEASURES, TABLE1, "kernel"), TABLE1, "kernel"
    )
    assert sentences[0].startswith("MS/rbf 1.50 mm, MS/affine 1.50 mm, 0 % less")
    assert "Vertex error over the mouth: 3.00 mm, 1.50 mm, 100 % more (worse)." in sentences[0]


def test_where_an_advantage_is_missing_the_other_figures_are_told():
    layers = np.full(CLIPS, 0.1)
    take = {
        "MS/rbf": sums(np.full(CLIPS, 2.0), layers),
        "MS/affine": sums(np.full(CLIPS, 2.0), layers),
    }
    rows = comparisons([(take, 100)], questions_of("kernel"), 200, 0.95, 0)
    (question, sentences), *_ = statements(
        rows, estimators(CURVES, MEASURES, TABLE1, "kernel"), TABLE1, "kernel"
    )
    assert question == "RBF network against affine map"
    why = sentences[1]
    assert "in the layers themselves its error on held-out frames is 0 % less (level)" in why
    assert "a linear map explains nearly all" in why
    assert "the true layers themselves leave a vertex error of 1.00 mm" in why


def test_a_baseline_without_cross_validation_is_not_said_to_equal_the_regressor_in_it():
    take = {"MS": sums(np.full(CLIPS, 2.0)), "contour": sums(np.full(CLIPS, 2.0))}
    rows = comparisons([(take, 100)], questions_of("kernel"), 200, 0.95, 0)
    found = estimators(CURVES, MEASURES, TABLE1, "kernel")
    ((question, sentences),) = statements(rows, found, TABLE1, "kernel")
    assert question == "The configured regressor against the contour baseline"
    assert "cross-validation" not in " ".join(sentences)
