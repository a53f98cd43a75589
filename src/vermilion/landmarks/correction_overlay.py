"""Detected against corrected landmarks over the images."""

from __future__ import annotations

import cv2
import numpy as np

from vermilion.imaging.draw import draw_points, draw_polyline, label, shown_frame, tile
from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.key_frames import KeyFrames
from vermilion.landmarks.scheme import LIP_INNER, LIP_OUTER
from vermilion.storage.frames import evenly_spaced

_SIDE_PX = 480
_DETECTED, _CORRECTED, _LIPS = (255, 60, 40), (60, 255, 60), (255, 255, 0)


def correction_overlay(
    source: FrameSource,
    camera: str,
    detected: LandmarkTrack,
    corrected: LandmarkTrack,
    keys: KeyFrames,
) -> np.ndarray:
    """Frames of `corrected`, evenly spread, cut to the face; (h, w, 3) uint8.

    Red: detected; green: corrected, with lines from red to green and yellow lips. Key frames are
    named in the label.

    Args:
        detected: of the same frames or more.
    """
    kinds = dict(zip(keys.frames.tolist(), keys.kinds.tolist(), strict=True))
    images = []
    for row in evenly_spaced(len(corrected.frames), 9):
        frame = int(corrected.frames[row])
        image = shown_frame(source, camera, frame)
        points = corrected.points_px[row]
        before = detected.points_px[np.searchsorted(detected.frames, frame)]
        text = f"{frame}" + (f": key frame ({kinds[frame]})" if frame in kinds else "")
        if not corrected.valid[row]:
            images.append(label(image, f"{frame}: no face found"))
            continue
        to_cut = _square_round(points)
        image = cv2.warpAffine(image, to_cut, (_SIDE_PX, _SIDE_PX), flags=cv2.INTER_AREA)
        points, before = (p @ to_cut[:, :2].T + to_cut[:, 2] for p in (points, before))
        for loop in (LIP_OUTER, LIP_INNER):
            image = draw_polyline(image, points[loop], _LIPS)
        if np.isfinite(before).all():
            for a, b in zip(before, points, strict=True):
                image = draw_polyline(image, np.stack([a, b]), _DETECTED, closed=False)
            image = draw_points(image, before, _DETECTED, 2)
        images.append(label(draw_points(image, points, _CORRECTED, 2), text))
    return tile(images, 3)


def _square_round(points_px: np.ndarray, margin: float = 0.08) -> np.ndarray:
    """Affine map (2, 3) of the square round points (N, 2) to the side of the overlay's images."""
    low, high = points_px.min(axis=0), points_px.max(axis=0)
    half = 0.5 * (1 + 2 * margin) * max(float((high - low).max()), 8.0)
    scale = _SIDE_PX / (2 * half)
    corner = 0.5 * (low + high) - half
    return np.array([[scale, 0, -corner[0] * scale], [0, scale, -corner[1] * scale]])
