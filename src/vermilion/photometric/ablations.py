"""The table of ablations: what each step of the track leaves unexplained."""

from __future__ import annotations

import pandas as pd

COLUMNS = ["subject", "take", "step", "residual", "held_out", "frames"]


def ablation_rows(table: pd.DataFrame) -> pd.DataFrame:
    """A row a take and step, in the order they come: mean residual, display values (0 to 255).

    `held_out` counts only frames that the appearance was not learnt from (NaN where there are none).

    Args:
        table: columns subject, take, step, frame, residual, and learnt_from (0 or 1) where known.
    """
    if table.empty:
        return pd.DataFrame(columns=COLUMNS)
    if "learnt_from" not in table:
        table = table.assign(learnt_from=0)
    table = table[table["residual"].notna()]
    fresh = table["residual"].where(table["learnt_from"].fillna(0) == 0)
    groups = table.assign(held_out=fresh).groupby(["subject", "take", "step"], sort=False)
    result = groups.agg(
        residual=("residual", "mean"), held_out=("held_out", "mean"), frames=("frame", "size")
    )
    return result.reset_index()[COLUMNS]
