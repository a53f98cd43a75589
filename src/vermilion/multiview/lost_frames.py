"""Frames in which the mesh has lost the lips: their pattern is not where the mesh carries it.

A mesh that loses the lips between two frames, in a motion too fast for its steps, looks right all
the same: the skin that it slides over is smooth, and its points lie on the surface. The pattern of
the lips tells it: carried from the neutral by the mesh, it differs from what the images show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vermilion.multiview.drift import ALL
from vermilion.storage.tables import read_table

_COLUMN = "difference_vermilion"


def failed_frames(
    quality: Sequence[str | Path], drift: Sequence[str | Path], lost: Mapping[str, float]
) -> dict[int, str]:
    """Frame -> why its mesh is not to be learnt from: it failed, or it lost the lips.

    Args:
        quality: quality rows of the reconstruction, of some chunks of a take.
        drift: as of `lost_frames`.
        lost: section `multiview.lost` of the configuration.
    """
    failed: dict[int, str] = {}
    for path in quality:
        table = read_table(path, ["frame", "valid"])
        failed |= dict.fromkeys(table.loc[table["valid"] == 0, "frame"], "the accurate mesh failed")
    return lost_frames(drift, **lost) | failed


def lost_frames(
    drift: Sequence[str | Path], difference: float, near_difference: float
) -> dict[int, str]:
    """Frame -> why its mesh is not to be learnt from.

    Args:
        drift: files of `multiview.drift.drift_rows`, of all chunks of a take.
        difference: a frame is lost where its lips differ by more (0: the same texture, 1.1: unrelated).
        near_difference: so are those before and after it, up to the first whose lips differ by less.

    Raises:
        InputError: a file cannot be read, or lacks a column.
    """
    found: dict[int, float] = {}
    for path in drift:
        table = read_table(path, ["frame", "camera", _COLUMN])
        rows = table[table["camera"] == ALL]
        found |= dict(zip(rows["frame"].astype(int), rows[_COLUMN].astype(float), strict=True))
    frames = sorted(found)
    lost = lost_rows(np.array([found[frame] for frame in frames]), difference, near_difference)
    return {
        frame: f"the lips' pattern differs from the neutral's by {found[frame]:.2f}: the mesh lost the lips at "
        f"a difference over {difference:g}; record more frames a second, or leave the frame out"
        for frame, is_lost in zip(frames, lost, strict=True)
        if is_lost
    }


def lost_rows(differences: np.ndarray, difference: float, near_difference: float) -> np.ndarray:
    """(F,) bool, runs of `differences` (F,) of at least `near_difference` in which one is over `difference`.

    What is not known, NaN, ends a run.
    """
    near = np.concatenate([[False], differences >= near_difference, [False]])
    starts, ends = (np.flatnonzero(np.diff(near.astype(int)) == sign) for sign in (1, -1))
    lost = np.zeros(len(differences), dtype=bool)
    for start, end in zip(starts, ends, strict=True):
        lost[start:end] = (differences[start:end] > difference).any()
    return lost
