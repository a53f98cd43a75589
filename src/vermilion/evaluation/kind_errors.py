"""Errors by kind of mouth shape."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import pandas as pd

from vermilion.evaluation.errors import ClipSums, by_clip, weighted_sums
from vermilion.evaluation.masks import Regions
from vermilion.evaluation.mouth_kinds import KINDS
from vermilion.evaluation.pooled import pooled, ratio_of
from vermilion.evaluation.statistics import Resampling

COLUMNS = (
    "kind", "region", "regressor", "mean_mm", "low_mm", "high_mm", "ratio_to_base", "ratio_low",
    "ratio_high", "frames", "clips",
)  # fmt: skip


def sums_of_kinds(
    errors_mm: np.ndarray, kinds: np.ndarray, regions: Regions, clips: np.ndarray
) -> ClipSums:
    """Sums behind the error of each kind of mouth shape.

    Args:
        errors_mm: (F, V) vertex errors.
        kinds: (F,) of `KINDS`.
        clips: (F,).
    """
    sums = {}
    for kind in KINDS:
        of_kind = kinds == kind
        for region in ("mouth", "vermilion"):
            of_frame = np.where(of_kind[:, None], errors_mm, np.nan)
            weight, total = weighted_sums(of_frame, regions.weights[region], clips)
            sums[f"{region}.{kind}_weight"], sums[f"{region}.{kind}_error"] = weight, total
        sums[f"{kind}_frames"] = by_clip(of_kind.astype(float), clips)
    return ClipSums(sums)


def kind_rows(
    takes: Sequence[tuple[dict[str, ClipSums], int]], samples: int, confidence: float, seed: int
) -> pd.DataFrame:
    """Error of every regressor by kind of mouth shape, all takes together, with intervals over clips.

    Args:
        takes: (regressor -> sums, frames) of each take.

    Returns:
        columns of `COLUMNS`; kinds that no frame has are left out.
    """
    rows = []
    for regressor, pool in pooled(takes).items():
        for kind, region in product(KINDS, ("mouth", "vermilion")):
            above, below = f"{region}.{kind}_error", f"{region}.{kind}_weight"
            if above not in pool.own.sums or not pool.own.sums[below].any():
                continue
            clips = int((pool.own.sums[f"{kind}_frames"] > 0).sum())
            resampling = Resampling.of(len(pool.own.sums[below]), samples, seed, confidence)
            mean, drawn = ratio_of(pool.own, above, below, resampling.draws)
            base, base_drawn = ratio_of(pool.base, above, below, resampling.draws)
            intervals = [
                resampling.interval(values) if clips > 1 else (np.nan, np.nan)
                for values in (drawn, drawn / base_drawn)
            ]
            frames = int(pool.own.sums[f"{kind}_frames"].sum())
            rows.append(
                (
                    kind,
                    region,
                    regressor,
                    mean,
                    *intervals[0],
                    mean / base,
                    *intervals[1],
                    frames,
                    clips,
                )
            )
    return pd.DataFrame(rows, columns=list(COLUMNS))
