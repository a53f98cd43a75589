"""Landmarks of another tracker: CSV of OpenFace, or of 66 or 68 points."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.scheme import FROM_68, N_LANDMARKS
from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_delimited

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class LandmarkTable:
    """Landmarks by frame number, as read from a file."""

    by_frame: dict[int, Landmarks]

    def at(self, frame: int) -> Landmarks:
        """Landmarks of a frame; none where the file has no such frame."""
        return self.by_frame.get(int(frame), Landmarks.none())


def read_landmark_csv(
    path: str | Path,
    first_frame: int = 1,
    pixel_centre: float = 0.0,
    min_confidence: float = 0.5,
) -> LandmarkTable:
    """Read columns frame, x_0.., y_0.., and where present confidence and success.

    Args:
        path: the file.
        first_frame: number that it gives to frame 0.
        pixel_centre: coordinates that it gives to the centre of the top-left pixel.
        min_confidence: rows with less count as not found.

    Raises:
        InputError: a column is missing, or a value is no number.
    """
    import pandas as pd

    table = read_delimited(path, ",", skipinitialspace=True)
    table.columns = [str(name).strip() for name in table.columns]
    n_points = _count_points(table, path)
    try:
        numbers = table.apply(pd.to_numeric)
    except (ValueError, TypeError) as error:
        raise InputError(
            f"a value that is no number ({error})", "numbers only", "Correct the file.", path=path
        ) from error
    x, y = (numbers[[f"{axis}_{k}" for k in range(n_points)]].to_numpy(float) for axis in "xy")
    points = np.stack([x, y], axis=-1) + (0.5 - pixel_centre)
    if n_points == 68:
        points = points[:, FROM_68]
    confidence = _column(numbers, "confidence")
    good = (confidence >= min_confidence) & (_column(numbers, "success") > 0)
    good &= np.isfinite(points).all(axis=(1, 2))
    frames = _frames(numbers["frame"].to_numpy(float), good, path) - first_frame
    return LandmarkTable(
        {
            int(frame): Landmarks(points[row], np.full(N_LANDMARKS, confidence[row]), True)
            for row, frame in enumerate(frames)
            if good[row]
        }
    )


def _frames(numbers: np.ndarray, good: np.ndarray, path: str | Path) -> np.ndarray:
    """Frame numbers (N,) of all rows, whole and once each among the rows that are `good` (N,)."""
    if not np.isfinite(numbers).all() or (numbers != np.rint(numbers)).any():
        raise InputError(
            "a row without the number of its frame",
            "a whole number",
            "Correct the file.",
            path=path,
        )
    frames = numbers.astype(np.int64)
    unique, count = np.unique(frames[good], return_counts=True)
    if (count > 1).any():
        raise InputError(
            f"frame {unique[count > 1][0]} in {count.max()} rows",
            "one row a frame",
            "Keep the rows of one face (OpenFace: of one face_id).",
            path=path,
        )
    return frames


def _count_points(table: pd.DataFrame, path: str | Path) -> int:
    """66 or 68. OpenFace's columns of eye and 3D landmarks have other names."""
    for count in (68, 66):
        wanted = [f"{axis}_{k}" for axis in "xy" for k in range(count)]
        if "frame" in table.columns and set(wanted) <= set(table.columns):
            return count
    found = sum(f"x_{k}" in table.columns for k in range(68))
    raise InputError(
        f"{found} of the columns x_0, x_1, ..."
        + ("" if "frame" in table.columns else " and no column frame"),
        "columns frame, x_0 to x_65 (or x_67), y_0 to y_65 (or y_67)",
        "Export 2D landmarks (OpenFace: option -2Dfp).",
        path=path,
    )


def _column(numbers: pd.DataFrame, name: str) -> np.ndarray:
    if name not in numbers.columns:
        return np.ones(len(numbers))
    return np.clip(np.nan_to_num(numbers[name].to_numpy(float)), 0.0, 1.0)
