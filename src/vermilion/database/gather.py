"""A take's layers and features, from its chunks to one entry of the database."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vermilion.database.schema import TakeEntry
from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError


def motion_mm(displacement_mm: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """How far (F,) mm the motion of a track is off in each frame, each vertex's median over the take removed.

    Args:
        displacement_mm: (F, N, 3) from **C** to the truth.
        weights: (N,) of the vertices in the mean.
    """
    moving = displacement_mm - np.median(displacement_mm, axis=0)
    return np.linalg.norm(moving, axis=2) @ weights / weights.sum()


def read_take_files(
    row: Mapping, layer_paths: Sequence[str | Path], feature_paths: Sequence[str | Path]
) -> tuple[TakeEntry, tuple[str, ...]]:
    """Join the chunks of a take, in order: its entry and the names of its features.

    Args:
        row: subject, take, fps, split, and `train`, the frame numbers that train.
        layer_paths, feature_paths: chunk files with `frames`, `valid` and `layers` with
            `displacement_mm`, or `features` and `names`.

    Raises InputError where the chunks disagree about frames or features.
    """
    place = {"subject": row["subject"], "take": row["take"]}
    layers, features = (
        [read_arrays(path, "part of the database", names, **place) for path in paths]
        for paths, names in (
            (layer_paths, ("frames", "layers", "displacement_mm", "valid")),
            (feature_paths, ("frames", "features", "names", "valid")),
        )
    )
    frames = np.concatenate([part["frames"] for part in layers])
    others = np.concatenate([part["frames"] for part in features])
    if not np.array_equal(frames, others):
        raise InputError(
            f"layers of {len(frames)} frames and features of {len(others)}",
            "the same frames",
            "Remove the take's `correction` folder and run again.",
            **place,
        )
    values = np.concatenate([part["features"] for part in features])
    valid = np.concatenate([part["valid"] for part in layers])
    valid &= np.concatenate([part["valid"] for part in features]) & np.isfinite(values).all(axis=1)
    entry = TakeEntry(
        **place,
        fps=row["fps"],
        split=row["split"],
        frames=frames,
        features=np.where(valid[:, None], values, 0.0),
        layers=np.concatenate([part["layers"] for part in layers]),
        displacement_mm=np.concatenate([part["displacement_mm"] for part in layers]),
        valid=valid,
        train=np.isin(frames, row["train"]),
    )
    return entry, tuple(str(name) for name in features[0]["names"])
