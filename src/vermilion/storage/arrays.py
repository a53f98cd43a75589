"""Named arrays in `.npz` files: written whole or not at all, read without pickle."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from vermilion.storage.errors import InputError, PlacedError
from vermilion.storage.files import atomic_path


def write_arrays(path: str | Path, *, compressed: bool = False, **arrays: Any) -> None:
    """Write arrays by name; the same arrays give the same bytes."""
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        (np.savez_compressed if compressed else np.savez)(stream, **arrays)


def write_array(path: str | Path, array: np.ndarray) -> None:
    """Write one `array` (...,) of any shape as `.npy`, whole or not at all."""
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.save(stream, array)


def read_arrays(
    path: str | Path,
    what: str,
    names: Iterable[str] | None = None,
    error: type[PlacedError] = InputError,
    **place: Any,
) -> dict[str, np.ndarray]:
    """Read the arrays of a file: those named, or all.

    Args:
        what: what the file should be, for the message ("landmark file").
        names: arrays that must be there; None: whatever there is.
        error: raised, with the `place` (subject, take, ...), where the file is missing, damaged or
            without an array.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            wanted = data.files if names is None else list(names)
            return {name: data[name] for name in wanted}
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as cause:
        contents = "" if names is None else f" with {', '.join(names)}"
        raise error(
            f"an unreadable {what} ({cause})",
            f"a .npz{contents}",
            "Remove the file and run again.",
            path=path,
            **place,
        ) from cause
