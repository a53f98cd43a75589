"""Which frames of a subject's takes tell who it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def spread_frames(valid: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Rows of each take, evenly spread over its valid frames, its first frame among them.

    Args:
        valid: take -> (F,) bool.
        count: rows of all takes together, about; every take with a valid frame has at least one.
    """
    usable = {take: np.flatnonzero(mask) for take, mask in valid.items()}
    usable = {take: rows for take, rows in usable.items() if len(rows)}
    each = max(1, round(count / max(len(usable), 1)))
    chosen = {}
    for take, rows in usable.items():
        places = np.linspace(0, len(rows) - 1, min(each, len(rows))).round().astype(int)
        chosen[take] = rows[np.unique(places)]
    return chosen
