"""The contour detector of a take where nobody labelled: what the configuration says, learnt from its frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vermilion.contours.lip_heights import LEAST_FRAMES
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_from_take
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.frames import evenly_taken

#: Frame -> outer and inner ring (n, 2) px of the lips, None where it has none.
Rings = Callable[[int], tuple[np.ndarray, np.ndarray] | None]


def detector_from_rings(
    section,
    read: Callable[[int], np.ndarray],
    landmarks: LandmarkTrack,
    rings: Rings,
    frames: list[int],
    dense: bool,
    around: Sequence[int] = (),
) -> TrackRidgeDetector | None:
    """The detector that a take's own images and rings of its lips tell; None where no frame serves.

    Args:
        section: `contours.detector` of the configuration.
        read: frame -> image (h, w, 3) linear RGB.
        landmarks: of the take, of any set.
        rings: of its frames.
        frames: numbers of those of the take that have rings; it is learnt from some of them.
        dense: whether the rings are those of dense landmarks, else of the tracked lips.
        around: numbers of frames before and after the take that have rings; it is learnt from all of them.
    """
    options, track = section.track, landmarks.as_ibug66()
    own = max(options.frames - len(around), min(options.frames, LEAST_FRAMES))
    points = dict(zip(track.frames.tolist(), track.points_px, strict=True))
    detector = TrackRidgeDetector.of(
        section, section.lips_reach if dense else options.inner_reach,
        frame_reach=options.frame_reach, lip_reach=options.lip_reach,
        lips_shade=section.lips_shade if dense else 0.0, lips_colours=section.lips_colours,
        lips_heights=section.lips_heights,
    )  # fmt: skip
    return learn_from_take(
        detector,
        sorted({*around, *evenly_taken(frames, own)}),
        read,
        points.__getitem__,
        rings,
        options.reach,
        inner=not dense,
    )
