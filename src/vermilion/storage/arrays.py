"""Named arrays in `.npz` files: written whole or not at all, read without pickle.

A file is looked at before it is read: arrays of Python objects, headers that promise more than the file
holds, and small files that unpack to gigabytes are refused.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile, ZipFile, ZipInfo

import numpy as np

from vermilion.storage.errors import InputError, PlacedError
from vermilion.storage.files import atomic_path

#: What numpy and zip archives raise on damaged files.
DAMAGE = (
    *(
        OSError,
        ValueError,
        KeyError,
        EOFError,
        TypeError,
        IndexError,
        AttributeError,
        OverflowError,
    ),
    *(MemoryError, RuntimeError, BadZipFile, zlib.error, SyntaxError, TokenError),
)
#: Values packed better than so are no measurement; smaller arrays harm nobody.
MOST_RATIO, HARMLESS_BYTES = 200, 1 << 28


class Arrays(dict[str, np.ndarray]):
    """Arrays of a file by name; one that is missing is the file's fault and raises its error."""

    def __init__(self, values: dict[str, np.ndarray], missing: Callable[[str], Exception]):
        """The `values` (...,) of any shape, and the error of a name that is `missing`."""
        super().__init__(values)
        self._missing = missing

    def __missing__(self, name: str) -> np.ndarray:
        raise self._missing(name)


def write_arrays(path: str | Path, *, compressed: bool = False, **arrays: Any) -> None:
    """Write arrays by name; the same arrays give the same bytes.

    Raises:
        ValueError: an array of Python objects, which only pickle could write.
    """
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        (np.savez_compressed if compressed else np.savez)(stream, allow_pickle=False, **arrays)


def write_array(path: str | Path, array: np.ndarray) -> None:
    """Write one `array` (...,) of any shape as `.npy`, whole or not at all; no Python objects."""
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.save(stream, array, allow_pickle=False)


def read_arrays(
    path: str | Path,
    what: str,
    names: Iterable[str] | None = None,
    error: type[PlacedError] = InputError,
    *,
    remedy: str = "Remove the file and run again.",
    version: int | None = None,
    **place: Any,
) -> Arrays:
    """Read the arrays of a file: those named, or all.

    Args:
        what: what the file should be, for the message ("landmark file").
        names: arrays that must be there; None: whatever there is.
        error: raised, with the `place` (subject, take, ...), where the file is missing, damaged or
            without an array.
        remedy: what to do then.
        version: what `format_version` among the arrays must be; None: nothing.
    """
    wanted = None if names is None else list(names)

    def unreadable(why: str) -> PlacedError:
        contents = "" if wanted is None else f" with {', '.join(wanted)}"
        return error(
            f"an unreadable {what} ({why})", f"a .npz{contents}", remedy, path=path, **place
        )

    try:
        _check_archive(path)
        with np.load(path, allow_pickle=False) as data:
            found = data.files if wanted is None else wanted
            arrays = Arrays(
                {name: data[name] for name in found}, lambda name: unreadable(f"no array '{name}'")
            )
    except DAMAGE as cause:
        raise unreadable(_one_line(cause)) from cause
    if version is not None and format_version(arrays) != version:
        was, wants = f"{what} format {format_version(arrays)}", f"format {version}"
        raise error(was, wants, remedy, path=path, **place)
    return arrays


def read_array(path: str | Path, what: str, **place: Any) -> np.ndarray:
    """The array (...,) of a `.npy` file, of any shape. Raises InputError with the `place` where it is missing or damaged."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(array, np.ndarray):
            raise ValueError("several arrays")
        return np.array(array)
    except DAMAGE as cause:
        raise InputError(
            f"unreadable {what} ({_one_line(cause)})",
            "a .npy",
            "Write it again.",
            path=path,
            **place,
        ) from cause


def format_version(arrays: dict[str, np.ndarray]) -> int:
    """The number `format_version` among the `arrays` (...,) of a file; -1 where there is none."""
    try:
        return int(arrays.get("format_version", -1))
    except (TypeError, ValueError):
        return -1


def check_unpacked(unpacked: int, stored: int) -> None:
    """Raise ValueError where a small part of a file unpacks to gigabytes (bytes)."""
    if unpacked > HARMLESS_BYTES and unpacked > MOST_RATIO * stored:
        raise ValueError(f"{stored} bytes that unpack to {unpacked / 2**20:.0f} MiB")


def _check_archive(path: str | Path) -> None:
    """Raise ValueError, or what is damaged raises, where the arrays of a `.npz` cannot be read safely."""
    with ZipFile(path) as archive:
        for entry in archive.infolist():
            check_unpacked(entry.file_size, entry.compress_size)
            if entry.filename.endswith(".npy"):
                _check_header(archive, entry)


def _check_header(archive: ZipFile, entry: ZipInfo) -> None:
    with archive.open(entry) as stream:
        version = np.lib.format.read_magic(stream)
        if version not in (
            (1, 0),
            (2, 0),
        ):  # 3.0 names fields in UTF-8, and no array here has fields
            raise ValueError(f"{entry.filename} of array format {version[0]}.{version[1]}")
        read = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, _, kind = read(stream)
        if kind.hasobject:
            raise ValueError(f"{entry.filename} holds Python objects, which are never read")
        promised, held = kind.itemsize, entry.file_size - stream.tell()
        for side in shape:
            promised *= side
        if promised != held:
            raise ValueError(f"{entry.filename} of {held} bytes, and its header says {promised}")


def _one_line(cause: Exception) -> str:
    text = " ".join(str(cause).split()) or type(cause).__name__
    return text if len(text) <= 200 else f"{text[:197]}..."
