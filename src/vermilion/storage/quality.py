"""Quality rows: one a frame and stage, with a validity flag and the reason of a failure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from vermilion.storage.tables import read_table, write_table

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("subject", "take", "stage", "frame", "valid", "reason")


@dataclass(frozen=True)
class QualityRow:
    """What one stage says of one frame. A valid row with a reason is a warning.

    `figures` are numeric columns with units in their names (`reprojection_px`).
    """

    frame: int
    valid: bool = True
    reason: str = ""
    figures: Mapping[str, float] = field(default_factory=dict)


def write_quality(
    path: str | Path, subject: str, take: str, stage: str, rows: Iterable[QualityRow]
) -> None:
    """Write the rows of a stage as TSV. An invalid row needs a reason."""
    records = []
    for row in rows:
        if not row.valid and not row.reason:
            raise ValueError(f"frame {row.frame}: an invalid row needs a reason")
        records.append(
            {
                "subject": subject,
                "take": take,
                "stage": stage,
                "frame": row.frame,
                "valid": int(row.valid),
                "reason": row.reason,
                **row.figures,
            }
        )
    write_table(path, records, COLUMNS)


def flagged_frames(paths: Iterable[str | Path]) -> pd.DataFrame:
    """Rows of many quality files that are invalid or warn, in order, the common columns only."""
    import pandas as pd

    tables = [read_table(path, COLUMNS)[list(COLUMNS)] for path in paths]
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    table = pd.concat(tables, ignore_index=True)
    flagged = table[(table["valid"] == 0) | table["reason"].notna()]
    return flagged.sort_values(["subject", "take", "stage", "frame"], ignore_index=True)
