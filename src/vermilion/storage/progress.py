"""Progress of long work, to the log: frames done, frames a second, time left."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")


def progress(
    items: Iterable[Item], what: str, total: int | None = None, every_s: float = 5.0
) -> Iterator[Item]:
    """Yield the items; print to standard error at most every `every_s` seconds and at the end."""
    if total is None:
        items = list(items)
        total = len(items)
    start = last = time.monotonic()
    for done, item in enumerate(items, start=1):
        yield item
        now = time.monotonic()
        if now - last >= every_s or done == total:
            rate = done / max(now - start, 1e-9)
            left = (total - done) / max(rate, 1e-9)
            print(
                f"{what}: {done} of {total}, {rate:.2f} a second, {left:.0f} s left",
                file=sys.stderr,
                flush=True,
            )
            last = now
