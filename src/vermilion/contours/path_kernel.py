"""The loop of `paths.cheapest_path`, compiled."""

from __future__ import annotations

import numpy as np

from vermilion.storage.kernels import kernel


@kernel()
def cheapest_totals(
    totals: np.ndarray, smoothness: np.ndarray, origin: np.ndarray
) -> None:  # pragma: no cover - compiled
    """Add to each cost of `totals` (n, m) that of the cheapest way there; `origin` (n, m) is where it comes from."""
    for row in range(1, totals.shape[0]):
        for column in range(totals.shape[1]):
            least, place = np.inf, 0
            for before in range(totals.shape[1]):
                away = float(column - before)
                through = totals[row - 1, before] + smoothness[row - 1] * (away * away)
                if through < least:
                    least, place = through, before
            totals[row, column] += least
            origin[row, column] = place
