"""Blend weights as CSV, a row a frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vermilion.storage.files import atomic_path


def write_weights(
    path: str | Path,
    frames: np.ndarray,
    fps: float,
    names: Sequence[str],
    weights: np.ndarray,
    valid: np.ndarray,
) -> None:
    """Write columns `frame,time_s,valid` and one a blend shape.

    Args:
        frames: (F,) frame numbers; `time_s` counts from the first.
        names: K names; weights: (F, K) in [0, 1]; valid: (F,) bool.
    """
    if weights.shape != (len(frames), len(names)):
        raise ValueError(f"weights must be ({len(frames)}, {len(names)}), got {weights.shape}")
    import pandas as pd

    table = pd.DataFrame(weights, columns=list(names))
    table.insert(0, "frame", frames)
    table.insert(1, "time_s", np.round((np.asarray(frames) - frames[0]) / fps, 6))
    table.insert(2, "valid", np.asarray(valid, dtype=int))
    with atomic_path(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g")
