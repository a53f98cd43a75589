"""Which frames stand for all of them, and which can be read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from vermilion.storage.errors import InputError

Item = TypeVar("Item")
Read = TypeVar("Read")


def evenly_spaced(n: int, count: int) -> np.ndarray:
    """Places of at most `count` of `n` items, evenly spaced, the first and the last among them.

    Args:
        n: number of items.
        count: wanted; one gives the first.

    Returns:
        (min(n, count),) int64, ascending.
    """
    return np.linspace(0, n - 1, min(count, n)).round().astype(np.int64)


def evenly_taken(frames: Sequence[int], count: int) -> set[int]:
    """At most `count` of the frames, evenly taken, the first and the last among them."""
    return {int(frames[index]) for index in evenly_spaced(len(frames), count)}


def readable(items: Iterable[Item], read: Callable[[Item], Read]) -> Iterator[tuple[Item, Read]]:
    """The items with what `read` gives; those for which it raises InputError are left out."""
    for item in items:
        try:
            found = read(item)
        except InputError:
            continue
        yield item, found
