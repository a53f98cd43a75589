"""Weighted statistics and intervals over clips."""

from __future__ import annotations

import numpy as np
import pytest

from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.measures import measure_rows
from vermilion.evaluation.statistics import (
    Resampling,
    clips_of,
    histogram_quantile,
    histograms,
)


def test_histogram_quantile_is_the_quantile_of_repeated_values_within_a_bin():
    rng = np.random.default_rng(2)
    values, weights = rng.gamma(2.0, 0.8, (7, 300)), rng.integers(1, 6, 300)
    repeated = np.repeat(values.ravel(), np.tile(weights, 7))
    for q in (0.5, 0.95):
        exact = np.quantile(repeated, q)
        found = histogram_quantile(histograms(values, weights), q, np.ones((1, 7)))
        assert abs(found[0] - exact) < 0.01


def test_quantile_of_a_sample_is_that_of_its_clips_joined():
    rng = np.random.default_rng(4)
    clips = histograms(rng.gamma(2.0, 0.8, (5, 40)), rng.integers(0, 4, 40))
    draws = np.array([[1, 0, 2, 0, 2], [0, 0, 0, 5, 0], [0, 0, 0, 0, 0]])
    for q in (0.5, 0.95):
        found = histogram_quantile(clips, q, draws)
        assert np.isnan(found[2])
        for sample in (0, 1):
            joined = np.repeat(clips, draws[sample], axis=0).sum(axis=0, keepdims=True)
            assert found[sample] == pytest.approx(histogram_quantile(joined, q, [[1]])[0])


def test_clips_break_at_gaps_and_at_their_length():
    frames = np.array([3, 4, 5, 6, 10, 11, 12, 13, 14])
    assert clips_of(frames, 3).tolist() == [0, 0, 0, 1, 2, 2, 2, 3, 3]
    assert clips_of(np.arange(9), 100, 3).tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_interval_covers_the_true_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(3)
    hits, trials = 0, 200
    for trial in range(trials):
        clip_means = rng.normal(2.0, 0.3, 25)
        sums = ClipSums({"mouth.error": clip_means, "mouth.weight": np.ones(25)})
        row = measure_rows({"base": sums}, "s", "t", 25, 400, 0.95, trial).iloc[0]
        hits += row["low"] <= 2.0 <= row["high"]
    assert 0.87 <= hits / trials <= 0.99


def test_interval_needs_two_clips_and_repeats_with_its_seed():
    sums = {"base": ClipSums({"mouth.error": np.ones(1), "mouth.weight": np.ones(1)})}
    row = measure_rows(sums, "s", "t", 5, 200, 0.95, 0).iloc[0]
    assert row["value"] == 1.0
    assert np.isnan(row["low"])
    assert np.isnan(row["high"])
    again = [Resampling.of(6, 50, 4, 0.9).draws for _ in range(2)]
    assert (again[0] == again[1]).all()
    assert (again[0].sum(axis=1) == 6).all()


def test_ratio_to_base_is_paired():
    """Clips differ much, the ratio does not: its interval is a point."""
    base = np.array([1.0, 5.0, 9.0, 2.0])
    ones = np.ones(4)
    sums = {
        "base": ClipSums({"mouth.error": base, "mouth.weight": ones}),
        "MS": ClipSums({"mouth.error": 0.7 * base, "mouth.weight": ones}),
    }
    rows = measure_rows(sums, "s", "t", 40, 500, 0.95, 0).set_index(["measure", "regressor"])
    ratio = rows.loc[("ratio_to_base", "MS")]
    assert ratio["value"] == pytest.approx(0.7)
    assert ratio["low"] == pytest.approx(0.7)
    assert ratio["high"] == pytest.approx(0.7)
    mean = rows.loc[("vertex_error_mean_mm", "base")]
    assert mean["high"] - mean["low"] > 1.0
