"""What was found in source files, kept beside the compiled ones: a file is parsed once, not at each start.

An entry is found by the content that it was made from, so none is ever out of date.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import sys
from functools import cache
from pathlib import Path

#: Of how many contents what was found is kept; the library has some six hundred files.
MOST = 4000
#: Content -> (digest of the code, names of modules that it imports).
Found = dict[str, tuple[str, tuple[str, ...]]]


class KnownCode:
    """The entries of one file. What cannot be read is none, what cannot be written is found again."""

    def __init__(self, path: Path):
        self.path = path
        self.found = _read(path)
        self._new: Found = {}

    def get(self, key: str) -> tuple[str, tuple[str, ...]] | None:
        """What was found in the content of this key."""
        return self.found.get(key)

    def add(self, key: str, digest: str, names: tuple[str, ...]) -> None:
        """Keep what was found; it is written by `write`."""
        self.found[key] = self._new[key] = (digest, names)

    def write(self) -> None:
        """Add to the file what is new, after what other processes have written since."""
        if not self._new:
            return
        entries = [*(_read(self.path) | self._new).items()][-MOST:]
        temporary = self.path.with_suffix(f".tmp.{os.getpid()}")
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(exist_ok=True)
            temporary.write_text(json.dumps(dict(entries)), encoding="utf-8")
            temporary.replace(self.path)
            self._new = {}


@cache
def known_code() -> KnownCode:
    """The entries of this Python, written as the process ends."""
    name = f"fingerprints.{sys.implementation.cache_tag}.json"
    known = KnownCode(Path(__file__).parent / "__pycache__" / name)
    atexit.register(known.write)
    return known


def _read(path: Path) -> Found:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {key: (digest, tuple(names)) for key, (digest, names) in content.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}
