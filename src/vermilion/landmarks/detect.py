"""Landmarks of the frames of a take, each flagged where no face was found or no image read."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vermilion.imaging.draw import draw_points, draw_polyline, label, shown_frame, tile
from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.detector import Landmarks, LandmarkTrack
from vermilion.landmarks.sets import IBUG66, LandmarkSet
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow

NOT_FOUND = "no face found"


def detect_frames(
    find: Callable[[int], Landmarks],
    frames: Sequence[int],
    landmark_set: LandmarkSet = IBUG66,
) -> tuple[LandmarkTrack, list[QualityRow]]:
    """Landmarks of some frames, and a quality row each.

    Args:
        find: landmarks of a frame; may raise InputError, which flags the frame.
        frames: frame numbers.
        landmark_set: the set that `find` gives.
    """
    entries, rows = [], []
    for frame in progress(frames, "landmarks"):
        reason = NOT_FOUND
        try:
            entry = find(frame)
        except InputError as error:
            entry, reason = Landmarks.none(landmark_set), str(error)
        confidence = {"confidence": round(float(entry.confidence.mean()), 4)}
        rows.append(QualityRow(frame, entry.found, "" if entry.found else reason, confidence))
        entries.append(entry)
    return LandmarkTrack.of(frames, entries), rows


def landmark_overlay(source: FrameSource, camera: str, track: LandmarkTrack) -> np.ndarray:
    """Frames of a track, evenly spread, with their landmarks; (h, w, 3) uint8."""
    images = []
    for row in evenly_spaced(len(track.frames), 8):
        frame = int(track.frames[row])
        image = shown_frame(source, camera, frame)
        found = Landmarks(
            track.points_px[row],
            track.confidence[row],
            bool(track.valid[row]),
            track.landmark_set,
        )
        text = f"{frame}" if found.found else f"{frame}: {NOT_FOUND}"
        images.append(label(draw_landmarks(image, found), text))
    return tile(images, 4)


def draw_landmarks(image: np.ndarray, found: Landmarks) -> np.ndarray:
    """A copy of `image` (h, w, 3) uint8 with points (green: sure, red: unsure) and both lip contours."""
    if not found.found:
        return image
    dense = found.landmark_set is not IBUG66  # large points would hide the face
    radius = 1 if dense else max(1, round(image.shape[1] / 400))
    for loop in (found.landmark_set.lip_outer, found.landmark_set.lip_inner):
        image = draw_polyline(image, found.points_px[loop], (255, 255, 0))
    sure = found.confidence >= 0.5
    image = draw_points(image, found.points_px[sure], (0, 255, 0), radius)
    return draw_points(image, found.points_px[~sure], (255, 0, 0), radius)
