"""Which frames of a take have drawn contours. The workflow asks at each start: it needs nothing else."""

from __future__ import annotations

import numpy as np


def label_frames(first: int, last: int, count: int) -> list[int]:
    """The frames whose contours are drawn: the neutral, and others evenly through the take."""
    if count <= 0:
        return []
    return sorted({round(f) for f in np.linspace(first, last, count + 1)[:count]})
