"""The table of ablations: the photometric residual after each step of the track."""

from __future__ import annotations

import pandas as pd

COLUMNS = ["subject", "take", "basis", "step", "residual", "held_out", "frames"]

#: Step -> colours of the mesh in its residual; all other steps use the track's light and albedo.
BASES = {
    "before_flow": "texture of the first frame",
    "flow": "texture of the first frame",
    "before_relief": "light and albedo of the first frames",
    "relief": "light and albedo of the first frames",
}


def ablation_rows(table: pd.DataFrame) -> pd.DataFrame:
    """A row a take and step, in order of appearance: mean residual, display values (0 to 255).

    Residuals are comparable only within a basis: the colours of the mesh (`BASES`). `held_out` is the
    mean over frames that the appearance was not estimated from; NaN where there are none.

    Args:
        table: columns subject, take, step, frame, residual, and learnt_from (0 or 1) where known.
    """
    if table.empty:
        return pd.DataFrame(columns=COLUMNS)
    if "learnt_from" not in table:
        table = table.assign(learnt_from=0)
    table = table.assign(basis=table["step"].map(BASES).fillna("appearance"))
    table = table[table["residual"].notna()]
    fresh = table["residual"].where(table["learnt_from"].fillna(0) == 0)
    groups = table.assign(held_out=fresh).groupby(["subject", "take", "basis", "step"], sort=False)
    result = groups.agg(
        residual=("residual", "mean"), held_out=("held_out", "mean"), frames=("frame", "size")
    )
    return result.reset_index()[COLUMNS]
