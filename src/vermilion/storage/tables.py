"""TSV tables with units in the column names, and delimited tables of other programs."""

from __future__ import annotations

import csv
import math
import numbers
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path

# pandas costs a quarter of a second: a job that only writes a few rows does without.
if TYPE_CHECKING:
    import pandas as pd

#: More columns than any tracker writes (OpenFace: 714). Ten thousands take a table's reader minutes.
MOST_COLUMNS = 5000
#: Longest header that is looked at (bytes).
_MOST_HEADER = 1 << 20


def write_table(
    path: str | Path,
    rows: pd.DataFrame | Sequence[Mapping[str, object]],
    columns: Sequence[str] = (),
) -> None:
    """Write rows as TSV, whole or not at all; floats with 9 significant digits, nothing for NaN.

    Args:
        path: of the file.
        rows: a table, or a mapping a row, which may leave columns out.
        columns: those that the header has before any other of the mappings.
    """
    with atomic_path(path) as temporary:
        if hasattr(rows, "to_csv"):
            rows.to_csv(temporary, sep="\t", index=False, float_format="%.9g", na_rep="")
            return
        names = list(dict.fromkeys([*columns, *(name for row in rows for name in row)]))
        with open(temporary, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, delimiter="\t", lineterminator="\n")
            writer.writerow(names)
            writer.writerows([_cell(row.get(name)) for name in names] for row in rows)


def _cell(value: object) -> object:
    """What a table holds of a value."""
    if value is None:
        return ""
    if isinstance(value, numbers.Real) and not isinstance(value, numbers.Integral):
        return "" if math.isnan(value) else f"{float(value):.9g}"
    return value


def read_table(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a TSV; raises InputError where a column of `columns` is missing."""
    table = read_delimited(path, "\t", keep_default_na=False, na_values=[""])
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise InputError(
            f"the columns {shortened(table.columns)}",
            f"also {missing}",
            "Add the columns to the header.",
            path=path,
        )
    return table


def read_delimited(
    path: str | Path, separator: str, place: Mapping[str, object] | None = None, **options: object
) -> pd.DataFrame:
    """A table of another program: one header line, UTF-8 with a byte order mark or without.

    Args:
        separator: between cells, `,` or a tab.
        place: subject and take, for messages.
        options: of pandas' `read_csv`.

    Raises:
        InputError: the file cannot be read, is no such table, or has a column twice or too many.
    """
    import pandas as pd

    what = "a TSV with a header" if separator == "\t" else "a CSV with a header"
    try:
        names = _header(path, separator)
        twice = [name for name, count in Counter(names).items() if name and count > 1]
        if len(names) > MOST_COLUMNS or twice:
            found = f"{len(names)} columns" if not twice else f"the column '{twice[0]}' twice"
            raise InputError(
                found,
                f"at most {MOST_COLUMNS} columns, each once",
                "Check the file.",
                path=path,
                **(place or {}),
            )
        return pd.read_csv(path, sep=separator, encoding="utf-8-sig", **options)
    except (OSError, ValueError, csv.Error, MemoryError, OverflowError) as error:
        raise InputError(
            f"an unreadable table ({' '.join(str(error).split())})",
            what,
            "Check the file.",
            path=path,
            **(place or {}),
        ) from error


def _header(path: str | Path, separator: str) -> list[str]:
    """Names of the columns, stripped; of a header that is too long as many as can be read."""
    with open(path, encoding="utf-8-sig", newline="") as stream:
        line = stream.readline(_MOST_HEADER)
    if line.count(separator) > MOST_COLUMNS:
        return [str(k) for k in range(line.count(separator) + 1)]
    return [name.strip() for name in next(csv.reader([line], delimiter=separator), [])]


def shortened(names: Sequence[object], most: int = 12) -> str:
    """Some names for a message: the first ones where there are many."""
    shown = [str(name)[:40] for name in names[:most]]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{shown}{more}"
