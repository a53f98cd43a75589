"""Disks that are full and folders that may not be written to, as one sentence that names the file."""

from __future__ import annotations

import errno
import getpass
import os
from pathlib import Path

from vermilion.storage.errors import PlacedError, VermilionError

#: With less than this left, a disk is full: what a library wrote last may have been cut off in silence.
_LEAST_FREE_BYTES = 64 * 1024
_FULL = (errno.ENOSPC, errno.EDQUOT)
_FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
_DISK_IS_FULL = "that the disk is full"
_DISK_IS_READ_ONLY = "a disk that is read-only"
_NO_PERMISSION = "no permission to write"


class UnwritableError(PlacedError):
    """A result cannot be written where it belongs."""


def explain(error: Exception, path: Path) -> Exception:
    """The error of writing `path`: a sentence where the disk or the folder is its reason, else `error`."""
    if isinstance(error, VermilionError):
        return error
    numbers = {
        cause.errno
        for cause in _causes(error)
        if isinstance(cause, OSError) and _is_of(cause, path.parent)
    }
    # Not every library passes on why it could not write.
    if numbers.intersection(_FULL) or _free_bytes(path.parent) < _LEAST_FREE_BYTES:
        return full_disk(path)
    if numbers.intersection(_FORBIDDEN):
        return _forbidden(path, errno.EROFS in numbers)
    return error


def is_of_the_disk(reason: str) -> bool:
    """Whether a failed job's reason is that it could not write: no input is to blame."""
    return any(found in reason for found in (_DISK_IS_FULL, _DISK_IS_READ_ONLY, _NO_PERMISSION))


def refuse_if_full(path: Path) -> None:
    """Refuse a file that was written until the disk was full: its writer may have said nothing.

    Raises:
        UnwritableError: hardly any space is left beside `path`.
    """
    if _free_bytes(path.parent) < _LEAST_FREE_BYTES:
        raise full_disk(path)


def _causes(error: BaseException | None) -> list[BaseException]:
    """An error, and what it came from."""
    found: list[BaseException] = []
    while error is not None and error not in found:
        found.append(error)
        error = error.__cause__ or error.__context__
    return found


def _is_of(error: OSError, folder: Path) -> bool:
    """Whether an error is of a folder: of a file in it, or of one that is not named."""
    if not isinstance(error.filename, (str, Path)):
        return True
    whole = Path(error.filename).absolute()
    return whole.is_relative_to(folder.absolute()) or folder.absolute().is_relative_to(whole)


def _free_bytes(folder: Path) -> float:
    """What may still be written to a folder's disk; root may also use what is reserved."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        disk = os.statvfs(folder)
    except OSError:
        return float("inf")
    if not disk.f_blocks:  # a file system that does not say
        return float("inf")
    return disk.f_frsize * (disk.f_bfree if os.geteuid() == 0 else disk.f_bavail)


def full_disk(path: Path) -> UnwritableError:
    """The sentence of a file for which the disk has no room."""
    free_kb = _free_bytes(path.parent) / 1024
    found = _DISK_IS_FULL + (f" ({free_kb:.0f} kB left)" if free_kb < 1e9 else "")
    return UnwritableError(
        found,
        "room for the results",
        "Make room, then run the same command again: it goes on from here.",
        path=path,
    )


def _forbidden(path: Path, read_only: bool) -> UnwritableError:
    found = _DISK_IS_READ_ONLY if read_only else _NO_PERMISSION
    return UnwritableError(
        found,
        f"a folder that user {_user()} may write to",
        f"Give the permission (`ls -ld {path.parent}` says who has it) or set `results` to another "
        "folder, then run the same command again.",
        path=path,
    )


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())
