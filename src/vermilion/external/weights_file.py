"""Blend weights of another tracker: a CSV a take, a row a frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_delimited

#: Columns that are no weights.
_OTHER = ("frame", "time_s", "valid")


def read_weights(
    path: str | Path,
    frames: Sequence[int],
    *,
    names: Sequence[str] | None = None,
    **place: Any,
) -> tuple[list[str], np.ndarray]:
    """Names of the blend shapes and the weights (F, K) of some frames; NaN where a frame has no row.

    Args:
        path: CSV with a column `frame` and one a blend shape, as `weights.csv` of `apply`.
        frames: (F,) numbers.
        names: blend shapes that are wanted, in this order; None: those of the file.
        place: subject and take, for messages.

    Raises:
        InputError: no such file, no column `frame`, no blend shapes or not those that are wanted, or
            values that are no numbers.
    """
    hint = "See docs/other_trackers.md, or correct tracking.external.base.weights."
    table = read_delimited(path, ",", skipinitialspace=True, place=place)
    known = [str(name) for name in table.columns if name not in _OTHER]
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
