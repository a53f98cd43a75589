"""Numbered files as cameras, renderers and trackers name them: `frame0001.png`, `IMG_0001.JPG`."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from vermilion.storage.errors import InputError

_NUMBER = re.compile(r"[0-9]+$")


def numbered_files(folder: str | Path, suffixes: Sequence[str]) -> dict[int, Path]:
    """Frame number -> file, of the one sequence in a folder, in order of number.

    The number is the digits at the end of a name before its suffix; what stands before them is the
    same for all files of a sequence. Suffixes are compared without case; hidden files, and files
    without a number, are left out.

    Raises:
        InputError: two sequences in the folder, or two files of one number; it names both.
    """
    sequences: dict[str, dict[int, Path]] = {}
    folder = Path(folder)
    # Of names, not of paths: the workflow looks at each of a facility's images.
    for name in sorted(os.listdir(folder)) if folder.is_dir() else ():
        stem, suffix = os.path.splitext(name)
        if name.startswith(".") or suffix.lower() not in suffixes:
            continue
        number = _NUMBER.search(stem)
        if number is None:
            continue
        path = folder / name
        files = sequences.setdefault(stem[: number.start()].casefold(), {})
        frame = int(number.group())
        if frame in files:
            raise InputError(
                f"two files of frame {frame}, '{files[frame].name}' and '{path.name}'",
                "one file a frame",
                "Move one of them to another folder.",
                path=folder,
            )
        files[frame] = path
    if len(sequences) > 1:
        one, other = list(sequences.values())[:2]
        raise InputError(
            f"{len(sequences)} sequences in one folder, {_described(one)} and {_described(other)}",
            "one sequence, whose files differ in their number alone",
            "Move the others to folders of their own.",
            path=folder,
        )
    return dict(sorted(next(iter(sequences.values()), {}).items()))


def _described(files: dict[int, Path]) -> str:
    first, last = files[min(files)].name, files[max(files)].name
    return f"'{first}'" if first == last else f"'{first}' to '{last}'"
