"""The study of Guided18 6.2 on a small generated take: what is left, and its rows."""

import numpy as np
import pytest

from tests.unit import guided_mouths as mouths
from vermilion.evaluation.guided_study import PropagationStudy, StudyPlan, study_rows
from vermilion.evaluation.measures import COLUMNS
from vermilion.evaluation.statistics import Resampling
from vermilion.report.guided_curve import draw_guided_curve


@pytest.fixture(scope="module")
def study() -> PropagationStudy:
    face = mouths.small_face()
    stable = np.flatnonzero(face.regions["rigid"])
    return PropagationStudy(mouths.small_take(), face.neutral_mm, mouths.small_regions(), stable)


def test_frames_that_trained_are_not_counted(study):
    left = study.left(np.array([2, 5]))
    assert not left.others[[2, 5]].any() and left.others.sum() == 10
    assert left.error_mm[[2, 5]].max() < 1e-6
    expected = left.error_mm[left.others].sum() / study.size_mm[left.others].sum()
    assert study.ratio(left) == pytest.approx(expected)


def test_sums_of_five_shapes_are_known_from_few_frames(study):
    """A take of five shapes: what one frame leaves is much, what eight frames leave is little."""
    few, many = (study.ratio(study.left(study.choose("suggested", k, 0))) for k in (1, 8))
    assert many < 0.05 < few < 1.0


def test_a_row_for_each_measure_number_and_choice(study, tmp_path):
    clips = np.repeat([0, 1, 2], 4)
    plan = StudyPlan((1, 3, 12), ("suggested", "random"), draws=4, seed=0)
    rows = study_rows(study, clips, ("s", "t"), plan, Resampling.of(3, 200, 0, 0.9))
    assert list(rows.columns) == list(COLUMNS)
    assert set(rows["regressor"]) == {f"guided/{k}/{c}" for k in (1, 3) for c in plan.choices}
    ratio = rows[rows["measure"] == "guided_ratio"].set_index("regressor")
    assert (ratio["region"] == "inner_lips").all()
    expected = study.ratio(study.left(study.choose("suggested", 3, 0)))
    assert ratio.loc["guided/3/suggested", "value"] == pytest.approx(expected)
    draws = [study.ratio(study.left(study.choose("random", 3, seed))) for seed in range(4)]
    assert ratio.loc["guided/3/random", "value"] == pytest.approx(np.median(draws))
    assert ((ratio["low"] <= ratio["value"]) & (ratio["value"] <= ratio["high"])).all()
    assert (ratio["frames"] == [11, 9, 11, 9]).all()
    draw_guided_curve(rows, "s/t", tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5000
