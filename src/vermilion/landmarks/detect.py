"""Landmarks of the followed face in the frames of a take, each flagged where it is not there."""

from __future__ import annotations

import numpy as np

from vermilion.imaging.draw import draw_points, draw_polyline, label, shown_frame, tile
from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.detector import Landmarks, LandmarkTrack
from vermilion.landmarks.faces import FaceFinds
from vermilion.landmarks.following import NOT_FOUND, FollowedFace
from vermilion.landmarks.sets import IBUG66
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.quality import QualityRow


def followed_track(
    finds: FaceFinds, followed: FollowedFace
) -> tuple[LandmarkTrack, list[QualityRow]]:
    """Landmarks of the followed face in a chunk's frames, and a quality row each.

    Args:
        finds: all faces of these frames.
        followed: the face of every frame of the take.
    """
    rows = np.searchsorted(followed.frames, finds.frames)
    entries, quality = [], []
    for faces, row in zip(finds.faces, rows, strict=True):
        valid = bool(followed.valid[row])
        face = faces[followed.face[row]] if valid else Landmarks.none(finds.landmark_set)
        figures = {
            "confidence": round(float(face.confidence.mean()), 4),
            "eyes_px": round(float(followed.eyes_px[row]), 1),
            "faces": float(followed.n_faces[row]),
            "piece": float(followed.piece[row] + 1),
        }
        reason = str(followed.reason[row])
        quality.append(QualityRow(int(followed.frames[row]), valid, reason, figures))
        entries.append(face)
    return LandmarkTrack.of(finds.frames.tolist(), entries, followed.piece[rows]), quality


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
