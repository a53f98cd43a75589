"""The figures of all takes together."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.measures import COLUMNS, measure_rows
from vermilion.evaluation.table1 import in_order, kind_of

#: What the rows of several takes together call their subject.
TOGETHER = "all"


def groups_of(roles: Sequence[str]) -> dict[str, list[int]]:
    """Name of a group of takes -> which of them: `all`, and a role each where there are several."""
    groups = {TOGETHER: list(range(len(roles)))}
    if len(set(roles)) > 1:
        for role in dict.fromkeys(roles):
            groups[role] = [index for index, other in enumerate(roles) if other == role]
    return groups


def kinds_of(of_take: dict[str, ClipSums]) -> dict[str, ClipSums]:
    """The sums of a take under `PS` and `GR` in place of `PS-<subject>` and `GR-<subject>`."""
    return {kind_of(name): sums for name, sums in of_take.items()}


def pooled_rows(
    takes: Sequence[tuple[dict[str, ClipSums], int]],
    samples: int,
    confidence: float,
    seed: int,
    group: str = TOGETHER,
) -> pd.DataFrame:
    """Rows of subject `all`: the clips of all takes, each person's own PS and GR joined.

    A regressor that some takes lack (the oracle needs a tattoo take) is measured on those that have
    it, its ratio against the base track of the same takes; the column `frames` tells.

    Args:
        takes: (regressor -> sums, frames) of each take.
        group: what the column `take` says.
    """
    named = [(kinds_of(of_take), frames) for of_take, frames in takes]
    tables = []
    for regressor in in_order({name for of_take, _ in named for name in of_take}):
        having = [(of_take, frames) for of_take, frames in named if regressor in of_take]
        sums = {
            name: ClipSums.joined([of_take[name] for of_take, _ in having])
            for name in dict.fromkeys(("base", regressor))
            if all(name in of_take for of_take, _ in having)
        }
        n_frames = sum(frames for _, frames in having)
        rows = measure_rows(sums, TOGETHER, group, n_frames, samples, confidence, seed)
        tables.append(rows[rows["regressor"] == regressor])
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    return pd.concat(tables, ignore_index=True)
