"""Which frames stand for all of them."""

from __future__ import annotations

import numpy as np


def evenly_spaced(n: int, count: int) -> np.ndarray:
    """Places of at most `count` of `n` items, evenly spaced, the first and the last among them.

    Args:
        n: number of items.
        count: wanted; one gives the first.

    Returns:
        (min(n, count),) int64, ascending.
    """
    return np.linspace(0, n - 1, min(count, n)).round().astype(np.int64)
