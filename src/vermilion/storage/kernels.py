"""Compiled functions: of several processes that need one at the same time, one compiles it.

The jobs that a run starts with need the same functions, and each would take seconds to compile them.
"""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numba

#: So long (s) a process waits for another one's compilation before it compiles by itself.
_PATIENCE_S = 120.0


def kernel(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator: `numba.njit` with these options, compiled once for all processes and later runs.

    Its file must hold all functions that it calls: numba's cache does not see changes elsewhere.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        compiled = numba.njit(cache=True, **options)(function)
        compiled._cache = _SharedCache(compiled._cache, function.__name__)
        return compiled

    return decorate


class _SharedCache:
    """numba's cache of a function, locked from a look-up in vain until the result is stored."""

    def __init__(self, cache: Any, name: str) -> None:
        self._cache, self._name = cache, name
        self._lock: IO[bytes] | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    def load_overload(self, *signature: Any) -> Any:
        found = self._cache.load_overload(*signature)
        if found is not None or self._lock is not None:
            return found
        self._lock = _locked(Path(self._cache.cache_path) / f"{self._name}.lock")
        found = self._cache.load_overload(*signature)
        if found is not None:
            self._release()
        return found

    def save_overload(self, *result: Any) -> None:
        try:
            self._cache.save_overload(*result)
        finally:
            self._release()

    def _release(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def _locked(path: Path) -> IO[bytes] | None:
    """The file, locked for this process; None where that cannot be, or takes too long."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = open(path, "ab")  # noqa: SIM115 - closed by whoever has it
    except OSError:
        return None
    until = time.monotonic() + _PATIENCE_S
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return file
        except BlockingIOError:
            if time.monotonic() > until:
                break
            time.sleep(0.05)
        except OSError:  # a file system without locks
            break
    file.close()
    return None
