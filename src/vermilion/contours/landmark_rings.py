"""The rings of the lips that dense landmarks draw: what contours start from where a detector gives them."""

from __future__ import annotations

import numpy as np

from vermilion.contours.curves import loop_spline
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.sets import IBUG66

#: Samples of a ring, as of the tracked lips.
N_SAMPLES = 80


class LandmarkRings:
    """The lips' rings in the frames of a track of landmarks."""

    def __init__(self, track: LandmarkTrack):
        """`track` with the points of its own set, which must have dense lips (`dense_lips`)."""
        self._set = track.landmark_set
        self._points = dict(zip(track.frames.tolist(), track.points_px, strict=True))
        self.frames = track.frames[track.valid].tolist()

    def __call__(self, frame: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Outer and inner ring (n, 2) px of a frame; None where no face was found.

        Sample 0 is the right corner of the mouth, n / 2 the left one, the upper lip between.
        """
        if frame not in self.frames:
            return None
        points = self._points[frame]
        outer, inner = (points[loop] for loop in (self._set.lip_outer, self._set.lip_inner))
        return loop_spline(outer, N_SAMPLES), loop_spline(inner, N_SAMPLES)


def dense_lips(track: LandmarkTrack) -> bool:
    """Whether a track's lips are nearer to the image's than a tracked mesh's, as dense sets' are."""
    return track.landmark_set is not IBUG66
