"""The figures of all takes together."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.measures import COLUMNS, measure_rows
from vermilion.evaluation.table1 import in_order, kind_of


def pooled_rows(
    takes: Sequence[tuple[dict[str, ClipSums], int]], samples: int, confidence: float, seed: int
) -> pd.DataFrame:
    """Rows with subject and take `all`: the clips of all takes, each person's own PS and GR joined.

    A regressor that some takes lack (the oracle needs a tattoo take) is measured on those that have
    it, its ratio against the base track of the same takes; the column `frames` tells.

    Args:
        takes: (regressor -> sums, frames) of each take.
    """
    named = [
        ({kind_of(name): sums for name, sums in of_take.items()}, frames)
        for of_take, frames in takes
    ]
    tables = []
    for regressor in in_order({name for of_take, _ in named for name in of_take}):
        having = [(of_take, frames) for of_take, frames in named if regressor in of_take]
        sums = {
            name: ClipSums.joined([of_take[name] for of_take, _ in having])
            for name in dict.fromkeys(("base", regressor))
            if all(name in of_take for of_take, _ in having)
        }
        n_frames = sum(frames for _, frames in having)
        rows = measure_rows(sums, "all", "all", n_frames, samples, confidence, seed)
        tables.append(rows[rows["regressor"] == regressor])
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    return pd.concat(tables, ignore_index=True)
