"""The study of Guided18 6.2 on a small generated take: what is left, and its rows."""

import numpy as np
import pytest

from tests.unit import guided_mouths as mouths
from vermilion.evaluation.guided_study import PropagationStudy, StudyPlan, study_rows
from vermilion.evaluation.measures import COLUMNS
from vermilion.evaluation.statistics import Resampling
from vermilion.imaging.images import read_image
from vermilion.report.guided_curve import draw_guided_curve
from vermilion.report.guided_sheet import draw_guided_sheet, shown_frames, surface_distance_mm


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


def test_distance_from_a_surface_is_across_it_not_along_it():
    grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    mesh = np.concatenate([grid, np.zeros((36, 1))], axis=1)
    corner = np.flatnonzero((grid < 5).all(axis=1))
    triangles = np.concatenate([
        np.stack([corner, corner + 1, corner + 6], axis=1),
        np.stack([corner + 1, corner + 7, corner + 6], axis=1),
    ]).astype(np.int32)  # fmt: skip
    inside = (grid[:, 0] < 5) & (grid[:, 1] < 5)
    moved = mesh + np.array([0.4, 0.3, 0.25])
    found = surface_distance_mm(moved, mesh, triangles)
    np.testing.assert_allclose(found[inside], 0.25, atol=1e-6)


def test_the_sheet_shows_frames_that_did_not_train_and_what_more_frames_bring(study, tmp_path):
    stable = np.flatnonzero(mouths.small_face().regions["rigid"])
    trained = np.arange(0, 12, 2)
    assert not np.isin(shown_frames(study, trained), trained).any()
    largest = draw_guided_sheet(study, (1, 6), stable, tmp_path / "sheet.png")
    assert largest[6] < 0.5 * largest[1]
    height, width, _ = read_image(tmp_path / "sheet.png").shape
    assert width == 3 * 300 and height > 1200 and (height - 46) % 600 == 0
