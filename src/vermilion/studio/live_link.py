"""Expression curves recorded by Live Link Face: a CSV of ARKit weights, a row a frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_delimited, shortened

#: ARKit shapes without a side that models may split in two.
SPLIT = ("browInnerUp", "cheekPuff")
#: A column without which the file holds no ARKit weights.
OPENING_COLUMN = "jawOpen"


def arkit_name(column: str) -> str:
    """`EyeBlinkLeft` -> `eyeBlink_L`; names without a side only change their first letter.

    `mouthLeft`, `mouthRight`, `jawLeft` and `jawRight` name a direction, not a side.
    """
    name = column[0].lower() + column[1:]
    if name in ("mouthLeft", "mouthRight", "jawLeft", "jawRight"):
        return name
    for side, suffix in (("Left", "_L"), ("Right", "_R")):
        if name.endswith(side):
            return name[: -len(side)] + suffix
    return name


def mirrored_weights(names: tuple[str, ...], weights: np.ndarray) -> np.ndarray:
    """`weights` (F, K) of the expressions `names` with left and right exchanged, (F, K).

    An expression whose counterpart is not among the names keeps its weight.
    """
    counterpart = [
        names.index(other) if other in names else k
        for k, other in enumerate(map(mirror_name, names))
    ]
    return weights[:, counterpart]


def mirror_name(name: str) -> str:
    """Name of the expression on the other side of the face; a symmetric one's is its own."""
    for side, other in (("_L", "_R"), ("_R", "_L"), ("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name


def read_live_link(
    path: str | Path,
    names: tuple[str, ...],
    n_frames: int,
    fps: float,
    csv_first: int = 0,
    csv_fps: float = 30.0,
) -> np.ndarray:
    """Weights (n_frames, K) of the model's expressions `names`, resampled to `fps`.

    Rows from `csv_first` on are used; an expression that the file lacks stays 0. Raises InputError
    where the file is no such table or has too few rows.
    """
    import pandas as pd

    table = read_delimited(path, ",")
    columns = {
        arkit_name(column): table[column] for column in table.columns if column[:1].isalpha()
    }
    for whole in SPLIT:
        if whole in columns:
            for suffix in ("_L", "_R"):
                columns.setdefault(whole + suffix, columns[whole])
    if OPENING_COLUMN not in columns:
        raise InputError(
            f"the columns {shortened(table.columns, 6)}",
            "ARKit weights (JawOpen, MouthPucker, ...)",
            "Export the take from Live Link Face as CSV.",
            path=path,
        )
    rows = csv_first + np.arange(n_frames) * (csv_fps / fps)
    if len(rows) and rows[-1] > len(table) - 1:
        raise InputError(
            f"{len(table)} rows",
            f"at least {int(np.ceil(rows[-1])) + 1} (from row {csv_first}, {n_frames} frames)",
            "Take fewer frames or an earlier first row.",
            path=path,
        )
    weights = np.zeros((n_frames, len(names)))
    index = np.arange(len(table))
    for k, name in enumerate(names):
        if name in columns:
            values = pd.to_numeric(columns[name], errors="coerce").to_numpy(float)
            given = columns[name].notna().to_numpy()
            if not np.isfinite(values[given]).all():
                raise InputError(
                    f"a value of {name} that is no finite number",
                    "weights from 0 to 1",
                    "Export the take from Live Link Face again.",
                    path=path,
                )
            values = np.where(given, values, 0.0)
            weights[:, k] = np.interp(rows, index, values)
    return np.clip(weights, 0.0, 1.0)
