"""Blend weights of another tracker: a CSV a take, a row a frame, also as Live Link Face writes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_delimited

#: Columns that are no weights.
_OTHER = ("frame", "time_s", "valid", "Timecode", "BlendshapeCount")
_TURNS = ("Yaw", "Pitch", "Roll")
_CODE = "Timecode"
#: Frames a second that timecodes count in.
_RATES = (24, 25, 30, 48, 50, 60, 120)


def read_weights(
    path: str | Path,
    frames: Sequence[int],
    *,
    names: Sequence[str] | None = None,
    first: int = 0,
    fps: float | None = None,
    **place: Any,
) -> tuple[list[str], np.ndarray]:
    """Names of the blend shapes and the weights (F, K) of some frames; NaN where a frame has no row.

    Args:
        path: CSV with a column `frame` and one a blend shape, as `weights.csv` of `apply`; or with a column
            `Timecode` (Live Link Face), whose first row is the take's first frame unless the timecode is the
            number of a frame of the take.
        frames: (F,) numbers.
        names: blend shapes that are wanted, in this order; None: those of the file.
        first: number of the take's first frame.
        fps: the take's frames a second, for timecodes.
        place: subject and take, for messages.

    Raises:
        InputError: no such file, no column `frame`, no blend shapes or not those that are wanted, or
            values that are no numbers.
    """
    hint = "See docs/other_trackers.md, or correct tracking.external.base.weights."
    table = read_delimited(path, ",", skipinitialspace=True, place=place)
    if "frame" not in table.columns and _CODE in table.columns and fps:
        table = _by_frame(table, frames, first, fps)
    known = [
        str(name) for name in table.columns if name not in _OTHER and not name.endswith(_TURNS)
    ]
    asked = known if names is None else list(names)
    missing = [name for name in ["frame", *asked] if name not in table.columns]
    if missing or not asked:
        raise InputError(
            f"columns {', '.join(known[:6]) or 'none'} without {', '.join(missing[:6])}",
            "`frame` and one a blend shape, the same in all takes", hint, path=path, **place,
        )  # fmt: skip
    try:
        numbers = table["frame"].to_numpy(dtype=np.float64)
        values = table[asked].to_numpy(dtype=np.float64)
        if not np.isfinite(numbers).all() or np.isinf(values).any():
            raise ValueError("a frame without a number, or an infinite weight")
        if len(set(numbers)) < len(numbers):
            raise ValueError("two rows of one frame")
    except ValueError as error:
        raise InputError(
            f"values that are no numbers ({error})", "numbers", hint, path=path, **place
        ) from error
    rows = {int(number): row for row, number in enumerate(numbers)}
    weights = np.full((len(frames), len(asked)), np.nan)
    for index, frame in enumerate(frames):
        if int(frame) in rows:
            weights[index] = values[rows[int(frame)]]
    return asked, weights


def _by_frame(table: pd.DataFrame, frames: Sequence[int], first: int, fps: float) -> pd.DataFrame:
    """The table with a column `frame` in the place of its timecodes; one row a frame of the take.

    A timecode that cannot be read has no frame, so that the table is refused.
    """
    parts = (
        table[_CODE]
        .astype(str)
        .str.extract(r"^(\d+):(\d+):(\d+)[:;](\d+(?:\.\d+)?)$")
        .astype(float)
    )
    hours, minutes, seconds, counted = parts.to_numpy().T
    most = float(np.nanmax(counted, initial=0.0))
    rate = next((rate for rate in _RATES if rate > most and rate > fps - 0.5), _RATES[-1])
    at = 3600.0 * hours + 60.0 * minutes + seconds + counted / rate
    numbers = at * fps
    if len(numbers) and not first <= round(numbers[0]) <= max(frames, default=first):
        numbers = numbers - numbers[0] + first
    result = table.assign(frame=np.where(np.isfinite(numbers), np.floor(numbers + 0.5), np.nan))
    return result[~(result["frame"].duplicated() & result["frame"].notna())]
