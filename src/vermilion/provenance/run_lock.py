"""One run at a time in a folder of results: who holds it, and whether the run before was killed.

The lock is the file system's, which frees it when its process ends, however that ends. What stands in
the file says who holds it; after a run that was killed it still stands there.
"""

from __future__ import annotations

import errno
import fcntl
import getpass
import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from vermilion.storage.errors import PlacedError
from vermilion.storage.unwritable import explain, refuse_if_full

#: Below the folder of results.
LOCK = Path("logs") / "run.lock"
#: The file system has no locks of this kind.
_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)


class FolderHeldError(PlacedError):
    """Another run is at work in the folder of results."""


@dataclass(frozen=True)
class Holder:
    """The process of a run: its user, host and number, and since when it runs."""

    user: str
    host: str
    pid: int
    since: str

    def __str__(self) -> str:
        return f"user {self.user}, host {self.host}, process {self.pid}, since {self.since}"


@dataclass(frozen=True)
class RunBefore:
    """What is known of the run before in a folder.

    Attributes:
        holder: of a run that did not end by itself; None where it did.
        is_over: whether it certainly runs no more: its lock is free, and it ran on this host.
    """

    holder: Holder | None
    is_over: bool

    @property
    def was_killed(self) -> bool:
        """It did not end by itself, and it runs no more."""
        return self.holder is not None and self.is_over


@contextmanager
def hold(results: Path) -> Iterator[RunBefore]:
    """Hold a folder of results for this process; yields what became of the run before.

    Raises:
        FolderHeldError: another run holds it; says who, and what to do.
        UnwritableError: the folder cannot be written to.
    """
    path = results / LOCK
    refuse_if_full(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Added to, not overwritten: it says who holds the lock before this process has it.
        stream = open(path, "a+", encoding="utf-8")  # noqa: SIM115 - closed below
    except OSError as error:
        raise explain(error, path) from error
    with stream:
        locked = _lock(stream.fileno(), results)
        before = _holder(path)
        is_over = locked and (before is None or before.host == socket.gethostname())
        try:
            _write(path, json.dumps(asdict(_this_process())) + "\n")
        except OSError as error:
            raise explain(error, path) from error
        try:
            yield RunBefore(before, is_over)
        except Exception:
            _ended(path)
            raise
        _ended(path)  # after an interrupt it stays: the next run puts things in order


def refuse_if_held(results: Path) -> None:
    """Refuse to start where another run is at work in a folder of results.

    Raises:
        FolderHeldError: see `hold`.
    """
    path = results / LOCK
    if path.is_file() and os.access(path, os.W_OK):
        with open(path, "r+", encoding="utf-8") as stream:
            _lock(stream.fileno(), results)


def _lock(handle: int, results: Path) -> bool:
    """Lock an open file; False where its file system has no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = _holder(results / LOCK)
        raise FolderHeldError(
            f"another run at work in it ({holder or 'it just began'})",
            "one run at a time",
            "Wait until it has ended"
            + (f", or stop it (`kill {holder.pid}` on {holder.host})" if holder else "")
            + ", then run the same command again; or set `results` to another folder.",
            path=results,
        ) from None
    except OSError as error:
        if error.errno in _NO_LOCKS:
            return False
        raise explain(error, results / LOCK) from error
    return True


def _holder(path: Path) -> Holder | None:
    """Who stands in the file; None where nobody does."""
    try:
        return Holder(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def _this_process() -> Holder:
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = str(os.getuid())
    since = time.strftime("%Y-%m-%d %H:%M:%S %Z")
    return Holder(user, socket.gethostname(), os.getpid(), since)


def _ended(path: Path) -> None:
    with suppress(OSError):
        _write(path, "")


def _write(path: Path, text: str) -> None:
    """Overwrite in place: another file would not be locked."""
    with open(path, "r+", encoding="utf-8") as stream:
        stream.truncate(0)
        stream.write(text)
