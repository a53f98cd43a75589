"""The table of ablations: what each step of the track leaves unexplained."""

from __future__ import annotations

import pandas as pd

COLUMNS = ["subject", "take", "basis", "step", "residual", "held_out", "frames"]

#: Step -> what it is measured with; all other steps with the track's own light and albedo.
BASES = {
    "before_flow": "texture of the first frame",
    "flow": "texture of the first frame",
    "before_relief": "light and albedo of the first frames",
    "relief": "light and albedo of the first frames",
}


def ablation_rows(table: pd.DataFrame) -> pd.DataFrame:
    """A row a take and step, in the order they come: mean residual, display values (0 to 255).

    Residuals compare within a basis only: what the mesh is coloured with before it is compared with
    the image (`BASES`). `held_out` counts only frames that the appearance was not learnt from (NaN where there are none).

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
