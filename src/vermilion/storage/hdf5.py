"""HDF5 files that are looked at before they are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py

from vermilion.storage.arrays import check_unpacked
from vermilion.storage.errors import PlacedError

#: What h5py raises on damaged or foreign files.
DAMAGE = (
    *(OSError, KeyError, ValueError, RuntimeError, TypeError, IndexError, AttributeError),
    *(OverflowError, MemoryError),
)


def open_hdf5(path: str | Path, unreadable: Callable[[str], PlacedError]) -> h5py.File:
    """Open a file for reading; the caller closes it.

    Args:
        unreadable: the error of a reason.

    Raises:
        what `unreadable` gives: no such file, not HDF5, truncated, values that lie in other files, or
        small data sets that unpack to gigabytes.
    """
    file = None
    try:
        file = h5py.File(path, "r")
        _check_group(file, set(), Path(path).stat().st_size)
        return file
    except DAMAGE as error:
        if file is not None:
            file.close()
        raise unreadable(" ".join(str(error).split())[:200]) from error


def _check_group(group: h5py.Group, seen: set[int], file_bytes: int) -> None:
    for name in group:
        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"'{group.name}/{name}' is a link, which is never followed")
        item = group[name]
        address = h5py.h5o.get_info(item.id).addr
        if address in seen:
            continue
        seen.add(address)
        if isinstance(item, h5py.Group):
            _check_group(item, seen, file_bytes)
        elif isinstance(item, h5py.Dataset):
            if item.is_virtual or item.external:
                raise ValueError(f"the values of '{item.name}' lie in another file")
            stored = item.id.get_storage_size()
            if stored > file_bytes:
                raise ValueError(f"'{item.name}' of {stored} bytes in a file of {file_bytes}")
            check_unpacked(item.nbytes, stored)
