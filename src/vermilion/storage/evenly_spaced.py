"""Some of many, evenly spaced: the frames that a sheet or an overlay shows."""

from __future__ import annotations

import numpy as np


def evenly_spaced(length: int, count: int) -> np.ndarray:
    """Rising rows (n,) int of a sequence, the first and the last among them; n <= `count`."""
    if length == 0:
        return np.zeros(0, dtype=int)
    return np.unique(np.linspace(0, length - 1, count).round().astype(int))
