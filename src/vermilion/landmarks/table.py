"""Landmarks of another tracker: a CSV, as OpenFace writes it, or a JSON file of points."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.point_file import read_point_file
from vermilion.landmarks.scheme import FROM_68
from vermilion.landmarks.sets import IBUG66, LandmarkSet, set_of
from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_delimited

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class LandmarkTable:
    """Landmarks by frame number, as read from a file, all of one set."""

    by_frame: dict[int, Landmarks]
    landmark_set: LandmarkSet = IBUG66

    def at(self, frame: int) -> Landmarks:
        """Landmarks of a frame; none where the file has no such frame."""
        return self.by_frame.get(int(frame), Landmarks.none(self.landmark_set))


@dataclass(frozen=True)
class GivenLandmarks:
    """How files of another tracker are read.

    Attributes:
        path: the file of a take; `.json`, or a CSV.
        set: name of the set of its points.
        first_frame: number that it gives to frame 0; None: 1 in a CSV (as OpenFace counts), 0 in JSON.
        pixel_centre: coordinates that it gives to the centre of the top-left pixel.
        min_confidence: frames with less count as not found.
    """

    path: str
    set: str
    first_frame: int | None
    pixel_centre: float
    min_confidence: float

    def read(self) -> LandmarkTable:
        """The landmarks of the file. Raises InputError where it is damaged or of another set."""
        kind, json = set_of(self.set), Path(self.path).suffix.lower() == ".json"
        first = self.first_frame if self.first_frame is not None else int(not json)
        if json:
            return LandmarkTable(
                read_point_file(self.path, kind, first, self.pixel_centre, self.min_confidence),
                kind,
            )
        return read_landmark_csv(self.path, kind, first, self.pixel_centre, self.min_confidence)


def read_landmark_csv(
    path: str | Path,
    landmark_set: LandmarkSet = IBUG66,
    first_frame: int = 1,
    pixel_centre: float = 0.0,
    min_confidence: float = 0.5,
) -> LandmarkTable:
    """Read columns frame, x_0.., y_0.., and where present confidence and success.

    Args:
        path: the file.
        landmark_set: what the points are; 68 points are taken for the 66 of `ibug66`.
        first_frame: number that it gives to frame 0.
        pixel_centre: coordinates that it gives to the centre of the top-left pixel.
        min_confidence: rows with less count as not found.

    Raises:
        InputError: a column is missing, or a value is no number.
    """
    import pandas as pd

    table = read_delimited(path, ",", skipinitialspace=True)
    table.columns = [str(name).strip() for name in table.columns]
    n_points = _count_points(table, landmark_set, path)
    try:
        numbers = table.apply(pd.to_numeric)
    except (ValueError, TypeError) as error:
        raise InputError(
            f"a value that is no number ({error})", "numbers only", "Correct the file.", path=path
        ) from error
    x, y = (numbers[[f"{axis}_{k}" for k in range(n_points)]].to_numpy(float) for axis in "xy")
    points = np.stack([x, y], axis=-1) + (0.5 - pixel_centre)
    if landmark_set is IBUG66 and n_points == 68:
        points = points[:, FROM_68]
    confidence = _column(numbers, "confidence")
    good = (confidence >= min_confidence) & (_column(numbers, "success") > 0)
    good &= np.isfinite(points).all(axis=(1, 2))
    frames = _frames(numbers["frame"].to_numpy(float), good, path) - first_frame
    return LandmarkTable(
        {
            int(frame): Landmarks(
                points[row], np.full(points.shape[1], confidence[row]), True, landmark_set
            )
            for row, frame in enumerate(frames)
            if good[row]
        },
        landmark_set,
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


def _count_points(table: pd.DataFrame, landmark_set: LandmarkSet, path: str | Path) -> int:
    """The set's points, or 68 for 66. OpenFace's columns of eye and 3D landmarks have other names."""
    n_points = landmark_set.n_points
    counts = (68, 66) if landmark_set is IBUG66 else (n_points,)
    for count in counts:
        wanted = [f"{axis}_{k}" for axis in "xy" for k in range(count)]
        if "frame" in table.columns and set(wanted) <= set(table.columns):
            return count
    found = sum(f"x_{k}" in table.columns for k in range(max(counts)))
    more = " (or x_67, y_67)" if landmark_set is IBUG66 else ""
    raise InputError(
        f"{found} of the columns x_0, x_1, ..."
        + ("" if "frame" in table.columns else " and no column frame"),
        f"columns frame, x_0 to x_{n_points - 1}, y_0 to y_{n_points - 1}{more}",
        "Export 2D landmarks (OpenFace: option -2Dfp).",
        path=path,
    )


def _column(numbers: pd.DataFrame, name: str) -> np.ndarray:
    if name not in numbers.columns:
        return np.ones(len(numbers))
    return np.clip(np.nan_to_num(numbers[name].to_numpy(float)), 0.0, 1.0)
