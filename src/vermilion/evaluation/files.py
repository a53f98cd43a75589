"""Files that evaluation's rules hand to one another."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.evaluation.errors import ClipSums
from vermilion.storage.arrays import read_arrays, write_arrays


def save_sums(path: str | Path, sums: dict[str, ClipSums], n_frames: int) -> None:
    """Write sums by clip of every regressor, names `<regressor>:<sum>`."""
    arrays = {
        f"{regressor}:{name}": values
        for regressor, of_regressor in sums.items()
        for name, values in of_regressor.sums.items()
    }
    write_arrays(path, compressed=True, n_frames=np.array(n_frames), **arrays)


def load_sums(path: str | Path) -> tuple[dict[str, ClipSums], int]:
    """Read what `save_sums` wrote: (regressor -> sums, frames)."""
    arrays = read_arrays(path, "file of the evaluation")
    n_frames = int(arrays.pop("n_frames"))
    sums: dict[str, dict[str, np.ndarray]] = {}
    for key, values in arrays.items():
        regressor, name = key.split(":", 1)
        sums.setdefault(regressor, {})[name] = values
    return {regressor: ClipSums(values) for regressor, values in sums.items()}, n_frames
