"""The figures of all takes together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vermilion.config.regressors import in_order, kind_of
from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.measures import COLUMNS, measure_rows

#: What the rows of several takes together call their subject.
TOGETHER = "all"


def groups_of(roles: Sequence[str]) -> dict[str, list[int]]:
    """Name of a group of takes -> which of them: `all`, and each role that several but not all have."""
    groups = {TOGETHER: list(range(len(roles)))}
    for role in dict.fromkeys(roles):
        if 1 < roles.count(role) < len(roles):
            groups[role] = [index for index, other in enumerate(roles) if other == role]
    return groups


def kinds_of(of_take: dict[str, ClipSums]) -> dict[str, ClipSums]:
    """The sums of a take under `PS` and `GR` in place of `PS-<subject>` and `GR-<subject>`."""
    return {kind_of(name): sums for name, sums in of_take.items()}


@dataclass(frozen=True)
class Pool:
    """A regressor over all takes that have it.

    Attributes:
        own: its sums.
        base: the base track's, of the same clips; empty where the takes have none.
        frames: measured.
    """

    own: ClipSums
    base: ClipSums
    frames: int


def pooled(takes: Sequence[tuple[dict[str, ClipSums], int]]) -> dict[str, Pool]:
    """Regressor (each person's own PS and GR joined) -> its clips of all takes that have it.

    Args:
        takes: (regressor -> sums, frames) of each take.
    """
    named = [(kinds_of(of_take), frames) for of_take, frames in takes]
    pools = {}
    for regressor in in_order({name for of_take, _ in named for name in of_take}):
        having = [(of_take, frames) for of_take, frames in named if regressor in of_take]
        has_base = all("base" in of_take for of_take, _ in having)
        pools[regressor] = Pool(
            ClipSums.joined([of_take[regressor] for of_take, _ in having]),
            ClipSums.joined([of_take["base"] for of_take, _ in having]) if has_base else ClipSums(),
            sum(frames for _, frames in having),
        )
    return pools


def ratio_of(sums: ClipSums, above: str, below: str, draws: np.ndarray) -> tuple[float, np.ndarray]:
    """The ratio of two sums over all clips, and over the clips of each sample, `draws` (samples, clips)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        whole = sums.sums[above].sum() / sums.sums[below].sum()
        return float(whole), (draws @ sums.sums[above]) / (draws @ sums.sums[below])


def pooled_rows(
    takes: Sequence[tuple[dict[str, ClipSums], int]],
    samples: int,
    confidence: float,
    seed: int,
    group: str = TOGETHER,
) -> pd.DataFrame:
    """Rows of subject `all`: the clips of all takes.

    A regressor that some takes lack (the oracle needs a tattoo take) is measured on those that have
    it, its ratio against the base track of the same takes; the column `frames` tells.

    Args:
        takes: (regressor -> sums, frames) of each take.
        group: what the column `take` says.
    """
    tables = []
    for regressor, pool in pooled(takes).items():
        sums = {regressor: pool.own}
        if pool.base.sums:
            sums = {"base": pool.base} | sums
        rows = measure_rows(sums, TOGETHER, group, pool.frames, samples, confidence, seed)
        tables.append(rows[rows["regressor"] == regressor])
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    return pd.concat(tables, ignore_index=True)
