"""TSV tables with units in the column names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path


def write_table(path: str | Path, rows: pd.DataFrame | Sequence[dict]) -> None:
    """Write rows as TSV, whole or not at all; floats with 9 significant digits."""
    table = rows if isinstance(rows, pd.DataFrame) else pd.DataFrame(list(rows))
    with atomic_path(path) as temporary:
        table.to_csv(temporary, sep="\t", index=False, float_format="%.9g", na_rep="")


def read_table(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a TSV; raises InputError where a column of `columns` is missing."""
    try:
        table = pd.read_csv(path, sep="\t", keep_default_na=False, na_values=[""])
    except (OSError, ValueError) as error:
        raise InputError(
            f"an unreadable table ({error})", "a TSV with a header", "Check the file.", path=path
        ) from error
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise InputError(
            f"columns {list(table.columns)}",
            f"also {missing}",
            "Add the columns to the header.",
            path=path,
        )
    return table
