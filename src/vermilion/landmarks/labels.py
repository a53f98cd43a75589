"""Landmarks that a person drew: `labels/landmarks/<camera>/<frame>.json` of a capture folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.imaging.label_file import check_in_image, load_label, points_of
from vermilion.imaging.source import Source, folder_of
from vermilion.landmarks.scheme import FROM_68, N_LANDMARKS
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class LandmarkLabel:
    """One labelled image: camera, frame, points (66, 2) in pixels, the file they come from."""

    camera: str
    frame: int
    points_px: np.ndarray
    path: Path | None = None


def label_files(capture: Source) -> list[Path]:
    """Label files of a capture folder or beside a video file, sorted by camera and frame."""
    return sorted((folder_of(capture, "labels") / "landmarks").glob("*/*.json"))


def read_landmark_label(path: str | Path) -> LandmarkLabel:
    """Read one file of 66 points (or 68, whose inner mouth corners are left out)."""
    path = Path(path)
    try:
        points = points_of(load_label(path).get("points"))
        frame = int(path.stem)
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(
            f"an unreadable landmark label ({error})",
            '{"unit": "px", "image": ..., "points": [[x, y] * 66]} in a file named by its frame',
            "Correct or remove the file.",
            path=path,
        ) from error
    if points.shape == (68, 2):
        points = points[FROM_68]
    if points.shape != (N_LANDMARKS, 2):
        raise InputError(
            f"points of shape {points.shape}",
            "66 finite points (x, y) in pixels",
            "Correct or remove the file.",
            camera=path.parent.name,
            frame=frame,
            path=path,
        )
    return LandmarkLabel(path.parent.name, frame, points, path)


def read_labels(capture: Source) -> Iterator[LandmarkLabel]:
    """All labels of a capture folder."""
    for path in label_files(capture):
        yield read_landmark_label(path)


def check_landmark_label(label: LandmarkLabel, size_px: tuple[int, int], **place: Any) -> None:
    """Raise InputError where a label does not lie in its image of `size_px` (width, height)."""
    named = {"camera": label.camera, "frame": label.frame}
    check_in_image(label.points_px, size_px, False, label.path, **named, **place)


def labels_by_frame(
    paths: Iterable[str | Path], size_px: tuple[int, int], **place: Any
) -> dict[int, np.ndarray]:
    """Points (66, 2) px of the label files of one camera, by frame number.

    Raises InputError where a file is damaged, or its points do not lie in images of `size_px`.
    """
    labels = [read_landmark_label(path) for path in paths]
    for label in labels:
        check_landmark_label(label, size_px, **place)
    return {label.frame: label.points_px for label in labels}
