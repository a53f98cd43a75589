"""The cells of the take sheet, as a person, an editor or a spreadsheet saved it."""

from __future__ import annotations

import csv
from pathlib import Path

from vermilion.storage.tables import shortened

COLUMNS = ("subject", "take", "role", "source", "first", "last", "fps", "split")
#: Columns that may be left out.
OPTIONAL_COLUMNS = ("face", "focal", "of", "eye_distance_mm")


def read_cells(path: Path) -> tuple[list[dict[str, str]], list[str]]:
    """Rows as column -> cell, stripped, and a sentence for each problem; with a problem there are no rows.

    UTF-8 with or without a byte order mark, any line ends; `#` begins a comment; a spreadsheet's
    quotation marks round a cell are taken off.

    Raises:
        OSError: the file cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        return [], [
            f"{path}: found text that is not UTF-8; expected a TSV in UTF-8. Save it so (in a "
            "spreadsheet: as CSV UTF-8 with tabs)."
        ]
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        return [], [f"{path}: found no rows; expected the columns {' '.join(COLUMNS)}. Write them."]
    header = [name.strip() for name in lines[0].split("\t")]
    wrong = [name for name in COLUMNS if name not in header]
    wrong += [name for name in header if name not in COLUMNS + OPTIONAL_COLUMNS]
    if wrong or len(set(header)) < len(header):
        twice = " (one of them twice)" if not wrong else ""
        return [], [
            f"{path}, header: found columns {shortened(header)}{twice}; expected {list(COLUMNS)}, "
            f"separated by tabs, and perhaps {list(OPTIONAL_COLUMNS)}. Correct the first line."
        ]
    rows, problems = [], []
    for number, line in enumerate(lines[1:], start=1):
        cells, problem = _cells(line)
        if len(cells) > len(header):
            problem = f"found {len(cells)} cells; expected {len(header)}, as the header has."
        if problem:
            problems.append(f"{path}, row {number}: {problem} Correct the row.")
        rows.append(dict(zip(header, cells, strict=False)))
    if not rows and not problems:
        problems = [f"{path}: found no take; expected a row a take. Add one."]
    rows = [{name: row.get(name, "") for name in header} for row in rows]
    return ([], problems) if problems else (rows, [])


def _cells(line: str) -> tuple[list[str], str]:
    """The cells of a line, and what is wrong with it."""
    try:
        cells = next(csv.reader([line], delimiter="\t", strict=True))
    except csv.Error:
        return [], "found a quotation mark that does not end, or ends within a cell; expected none."
    return [cell.strip() for cell in cells], ""
