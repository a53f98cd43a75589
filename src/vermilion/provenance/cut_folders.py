"""Folders of results that a killed run was about to remove, and of which it left a part.

Snakemake removes what a job made before it makes it again, a folder file by file, and takes a folder that
is there for whole.
"""

from __future__ import annotations

import base64
import binascii
import os
from pathlib import Path

#: Snakemake writes it into a folder when its job has ended; nothing is added or removed afterwards.
_STAMP = ".snakemake_timestamp"
#: The stamp's own time is set a little before or after it is added.
_SLACK_S = 1.0


def cut_folders(results: Path, records: Path = Path(".snakemake/metadata")) -> list[Path]:
    """Folders of the results from which something was removed after their job had ended.

    Args:
        results: the folder of results, as the outputs are named.
        records: Snakemake's records of outputs, one a file.
    """
    return sorted(
        path
        for path in _recorded(records)
        if path.is_relative_to(results)
        and path.is_dir()
        and not path.is_symlink()
        and _is_cut(path)
    )


def _is_cut(folder: Path) -> bool:
    stamp = folder / _STAMP
    return not stamp.exists() or folder.stat().st_mtime > stamp.stat().st_mtime + _SLACK_S


def _recorded(records: Path) -> list[Path]:
    """Outputs of which Snakemake has a record: their names are in the records' names."""
    found = []
    for place, _, names in os.walk(records):
        head = "".join(part.removeprefix("@") for part in Path(place).relative_to(records).parts)
        for name in names:
            try:
                found.append(Path(base64.urlsafe_b64decode(head + name).decode()))
            except (binascii.Error, UnicodeDecodeError):
                continue
    return found
