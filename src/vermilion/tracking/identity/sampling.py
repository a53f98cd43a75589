"""The frames of a subject's takes to which the person is fitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.geometry.camera import Camera, read_cameras
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.sets import IBUG66
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.json_files import load_json
from vermilion.tracking.identity.landmark_identity import TakeSample
from vermilion.tracking.landmark_fit.observation import Observations, focal_px


@dataclass(frozen=True)
class SampledFrames:
    """Frames of a take to which the person is fitted.

    Attributes:
        sample: landmarks of the frames.
        camera: of the take.
        frames: (n,) numbers of the frames.
    """

    sample: TakeSample
    camera: Camera
    frames: np.ndarray


def sample_takes(
    takes: Sequence[Mapping[str, Any]],
    landmarks: Sequence[str],
    cameras: Sequence[str],
    calibrations: Sequence[str],
    count: int,
) -> list[SampledFrames]:
    """Frames of all of a subject's takes.

    Args:
        takes: of each take its name (`take`), its camera (`camera`), the frame that shows the
            neutral or None (`neutral`), and the number of its files in `landmarks` (`chunks`).
        landmarks: landmark files of all takes, take by take.
        cameras, calibrations: folder of cameras and summary of the calibration, one a take.
        count: wanted number of frames, over all takes.

    Raises:
        InputError: no frame of any take has a face that can be used.
    """
    paths: Iterator[str] = iter(landmarks)
    tracks = {
        row["take"]: LandmarkTrack.load([next(paths) for _ in range(row["chunks"])])
        for row in takes
    }
    _require_a_face(tracks, landmarks)
    chosen = spread_frames({name: track.valid for name, track in tracks.items()}, count)
    found = []
    for row, folder, summary in zip(takes, cameras, calibrations, strict=True):
        name, camera = row["take"], read_cameras(folder)[row["camera"]]
        rows = chosen.get(name, np.zeros(0, dtype=int))
        frames = tracks[name].frames[rows]
        calibrated = bool(load_json(summary)["calibrated"])
        seen = Observations.of(tracks[name], camera)[rows]
        neutral = frames == row["neutral"]
        sample = TakeSample(name, seen, focal_px(camera), calibrated, neutral)
        found.append(SampledFrames(sample, camera, frames))
    return found


def _require_a_face(tracks: Mapping[str, LandmarkTrack], landmarks: Sequence[str]) -> None:
    if any(track.valid.any() for track in tracks.values()):
        return
    count = sum(len(track.valid) for track in tracks.values())
    folders = sorted({Path(path).parent.as_posix() for path in landmarks})
    raise InputError(
        f"no usable face in any of {count} frames of {', '.join(tracks)}",
        "a face in at least one",
        f"See {', '.join(f'{folder}/overlay' for folder in folders)}; the reason of each frame is in the "
        "folder quality beside it.",
    )


def tells_lips(landmarks: list[str]) -> bool:
    """Whether the landmarks of all takes (files) draw lips as people have them: those of dense sets do."""
    return all(LandmarkTrack.load(path, None).landmark_set is not IBUG66 for path in landmarks)


def spread_frames(valid: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Rows (n,) of each take, evenly spaced over its valid frames, the first among them.

    Args:
        valid: take -> (F,) bool.
        count: wanted number of rows, over all takes; a take with a valid frame has at least one.
    """
    usable = {take: np.flatnonzero(mask) for take, mask in valid.items()}
    usable = {take: rows for take, rows in usable.items() if len(rows)}
    each = max(1, round(count / max(len(usable), 1)))
    return {take: rows[evenly_spaced(len(rows), each)] for take, rows in usable.items()}
