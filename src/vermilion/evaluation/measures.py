"""The rows of `measures.tsv`, of sums by clip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from vermilion.config.regressors import kind_of
from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.masks import REGION_NAMES
from vermilion.evaluation.statistics import Resampling, histogram_quantile

COLUMNS = (
    "measure", "region", "subject", "take", "regressor", "value", "unit", "low", "high", "frames",
)  # fmt: skip

#: measure, numerator, denominator, unit: the ratio of two sums.
_RATIOS = (
    ("vertex_error_mean_mm", "error", "weight", "mm"),
    ("lip_motion_error_mm", "motion", "motion_weight", "mm"),
    ("lip_shape_error_mm", "shape", "shape_weight", "mm"),
    ("lve_mm2", "lve", "lve_frames", "mm2"),
    ("jitter_mm", "jitter", "jitter_weight", "mm"),
    ("drift_mm", "drift", "drift_weight", "mm"),
    ("aperture_error_mm", "aperture", "aperture_frames", "mm"),
    ("false_open_rate", "false_open", "touch_frames", "1"),
    ("lip_penetration_rate", "through", "through_frames", "1"),
    ("flipped_rate", "flipped", "flipped_frames", "1"),
    ("inner_mouth_rate", "inner_mouth", "inner_mouth_frames", "1"),
    ("edge_roughness_ratio", "roughness", "base_roughness", "1"),
    ("contour_error_px", "contour", "contour_frames", "px per px of inter-ocular distance"),
)
#: measure, numerator, denominator: the ratio of two sums over that of the base track.
_RATIOS_TO_BASE = (
    ("ratio_to_base", "error", "weight"),
    ("lip_motion_ratio", "motion", "motion_weight"),
    ("aperture_ratio", "aperture", "aperture_frames"),
)
_QUANTILES = (("surface_error_median_mm", 0.5), ("surface_error_p95_mm", 0.95))


def measure_rows(
    sums: dict[str, ClipSums],
    subject: str,
    take: str,
    n_frames: int,
    samples: int,
    confidence: float,
    seed: int,
) -> pd.DataFrame:
    """Every figure of one take, or of takes joined, with its interval over clips.

    Each bootstrap sample draws the same clips for all regressors, so that `ratio_to_base` compares
    like with like.

    Args:
        sums: regressor -> sums by clip.
        n_frames: frames measured.
        samples, confidence, seed: of the bootstrap.
    """
    rows = []
    for regressor, of_regressor in sums.items():
        n_clips = len(next(iter(of_regressor.sums.values())))
        resampling = Resampling.of(n_clips, samples, seed, confidence)
        base = sums.get("base") if regressor not in ("base", "H") else None
        for measure, region, unit, value, sampled in _figures(of_regressor, base, resampling.draws):
            if np.isfinite(value):
                low, high = resampling.interval(sampled)
                rows.append(
                    (measure, region, subject, take, regressor, value, unit, low, high, n_frames)
                )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def seconds_rows(tables: Sequence[pd.DataFrame], frames: Mapping[str, int]) -> pd.DataFrame:
    """`seconds_per_frame` of every take, and the mean over frames of all takes, without intervals.

    Args:
        tables: columns subject, take, regressor, seconds_per_frame, a table a take.
        frames: `subject/take` -> frames measured.
    """
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    rows = pd.concat(tables, ignore_index=True)
    rows["frames"] = [
        frames[f"{s}/{t}"] for s, t in zip(rows["subject"], rows["take"], strict=True)
    ]
    rows = rows.dropna(subset="seconds_per_frame")
    together = (
        rows.assign(
            regressor=rows["regressor"].map(kind_of),
            total=rows["seconds_per_frame"] * rows["frames"],
        )
        .groupby("regressor", sort=False)[["total", "frames"]]
        .sum()
    )
    together = together.reset_index().assign(
        subject="all",
        take="all",
        seconds_per_frame=together["total"].values / together["frames"].values,
    )
    joined = pd.concat([together, rows], ignore_index=True)
    values = joined["seconds_per_frame"].map(lambda seconds: float(f"{seconds:.3g}"))
    return joined.assign(
        measure="seconds_per_frame", region="mouth", value=values, unit="s", low=np.nan, high=np.nan
    )[list(COLUMNS)]


def _figures(of_regressor: ClipSums, base: ClipSums | None, draws: np.ndarray):
    """Yield (measure, region, unit, value, value of each sample)."""
    sums = of_regressor.sums
    for region in REGION_NAMES:
        for measure, above, below, unit in _RATIOS:
            yield from _ratio(sums, measure, region, above, below, unit, draws)
        if f"{region}.square" in sums:
            value, sampled = _both(_deviation, sums, region, draws)
            yield "vertex_error_std_mm", region, "mm", value, sampled
        if f"{region}.feature_square" in sums:
            value, sampled = _both(_root_mean_square, sums, region, draws)
            yield "feature_error", region, "1", value, sampled
        if f"{region}.histogram" in sums:
            yield from _surface(sums, region, draws)
        if base is None:
            continue
        for measure, above, below in _RATIOS_TO_BASE:
            yield from _ratio_to_base(sums, base.sums, measure, region, above, below, draws)


def _ratio(sums, measure, region, above, below, unit, draws):
    above, below = f"{region}.{above}", f"{region}.{below}"
    if above in sums:
        value = _divide(sums[above].sum(), sums[below].sum())
        yield measure, region, unit, float(value), _divide(draws @ sums[above], draws @ sums[below])


def _ratio_to_base(sums, base, measure, region, above, below, draws):
    above, below = f"{region}.{above}", f"{region}.{below}"
    if above in sums and above in base:
        everything = np.ones((1, draws.shape[1]), dtype=np.int64)
        whole, sampled = (
            _divide(
                _divide(d @ sums[above], d @ sums[below]), _divide(d @ base[above], d @ base[below])
            )
            for d in (everything, draws)
        )
        yield measure, region, "1", float(whole[0]), sampled


def _surface(sums, region, draws):
    histogram, largest = sums[f"{region}.histogram"], sums[f"{region}.max"]
    for measure, q in _QUANTILES:
        everything = np.ones((1, draws.shape[1]), dtype=np.int64)
        whole, sampled = (histogram_quantile(histogram, q, d) for d in (everything, draws))
        yield measure, region, "mm", float(whole[0]), sampled
    sampled = np.where(draws > 0, largest, 0.0).max(axis=1)
    yield "surface_error_max_mm", region, "mm", float(largest.max()), sampled


def _both(statistic, sums, region, draws):
    """A statistic of all clips together, and of each sample."""
    everything = np.ones((1, draws.shape[1]), dtype=np.int64)
    return float(statistic(sums, region, everything)[0]), statistic(sums, region, draws)


def _mean(sums, region, draws):
    return _divide(draws @ sums[f"{region}.error"], draws @ sums[f"{region}.weight"])


def _deviation(sums, region, draws):
    mean = _mean(sums, region, draws)
    square = _divide(draws @ sums[f"{region}.square"], draws @ sums[f"{region}.weight"])
    return np.sqrt(np.maximum(square - mean**2, 0.0))


def _root_mean_square(sums, region, draws):
    above, below = sums[f"{region}.feature_square"], sums[f"{region}.feature_entries"]
    return np.sqrt(_divide(draws @ above, draws @ below))


def _divide(above, below):
    above, below = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
    return np.divide(above, below, out=np.full(above.shape, np.nan), where=below > 0)
