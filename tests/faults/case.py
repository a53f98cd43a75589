"""One malformed input: how it is made, which reader of the workflow meets it, what must follow.

`VERMILION_FAULT_SEEDS=20` makes every input with that many seeds instead of its kept one.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vermilion.storage.errors import PlacedError, VermilionError

#: What an error may cost, and what a message may be long.
MOST_SECONDS, MOST_BYTES, MOST_LETTERS = 10.0, 2**30, 1500
#: What a library's own report of an error looks like.
_FOREIGN = re.compile(r"Traceback|File \"|line \d+, in |\b0x[0-9a-f]{6,}|object at ")


@dataclass(frozen=True)
class Case:
    """A malformed input.

    Attributes:
        name: what is wrong.
        make: writes it into an empty folder; returns the path that is read.
        read: the library call by which the workflow reads it.
        says: what the message says, a regular expression.
        right: given for an input that is harmless: checks what was read.
        names: name that the message has; None: that of the path.
        heavy: its memory is also measured in a process of its own.
        seed: of the random part of `make`.
    """

    name: str
    make: Callable[[Path, np.random.Generator], Path]
    read: Callable[[Path], Any]
    says: str = ""
    right: Callable[[Any], Any] | None = None
    names: str | None = None
    heavy: bool = False
    seed: int = 1

    @property
    def seeds(self) -> range:
        count = int(os.environ.get("VERMILION_FAULT_SEEDS", "1"))
        return range(self.seed, self.seed + count)


def parametrized(cases: list[Case]) -> Any:
    """Each case a test, once a seed."""
    names = [case.name for case in cases]
    assert len(set(names)) == len(names), "two cases of one name"
    return pytest.mark.parametrize(
        ("case", "seed"),
        [
            pytest.param(case, seed, id=f"{case.name}-{seed}")
            for case in cases
            for seed in case.seeds
        ],
    )


def check(case: Case, seed: int, folder: Path) -> None:
    """Make an input, read it, and assert what is promised of it."""
    path = case.make(folder, np.random.default_rng(seed))
    before = _contents(folder)
    reset_peak()
    memory, start, waited = peak_bytes(), time.process_time(), time.monotonic()
    if case.right is not None:
        assert case.right(case.read(path)) is not False
    else:
        error = refusal_of(case, path)
        check_sentence(error, case.names or path.name, case.says, folder)
    # Of the processor, so that a busy machine fails no test; waiting for something shows in the other.
    assert time.process_time() - start < MOST_SECONDS
    assert time.monotonic() - waited < 10 * MOST_SECONDS
    assert peak_bytes() - memory < MOST_BYTES
    assert _contents(folder) == before, "something was written"


def refusal_of(case: Case, path: Path) -> VermilionError:
    """The error of Vermilion that reading gives; any other one is a failure."""
    try:
        found = case.read(path)
    except VermilionError as error:
        return error
    pytest.fail(f"read as {found!s:.200}")


def check_sentence(error: VermilionError, name: str, says: str, folder: Path) -> None:
    """The message names the file, what was found and expected, a remedy, and no library's report."""
    message = str(error).replace(str(folder), "")
    assert name in message, f"{name!r} is not named in: {message}"
    assert re.search(says, message), f"{says!r} is not said in: {message}"
    assert len(message) < MOST_LETTERS, f"{len(message)} letters: {message[:300]}"
    assert not _FOREIGN.search(message), message
    assert "found " in message and "expected" in message, message
    if isinstance(error, PlacedError):
        remedy = message.rsplit("; expected ", 1)[1].partition(". ")[2]
        assert remedy.strip().endswith(".") and len(remedy) > 10, f"no remedy in: {message}"


def _contents(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def reset_peak() -> None:
    """Let `peak_bytes` begin anew (Linux)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_bytes() -> int:
    """Most memory that this process has held since `reset_peak`, bytes."""
    try:
        status = Path("/proc/self/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) * 1024
    except (OSError, TypeError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
