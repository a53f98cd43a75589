"""Key frames inside a clip, settled by flow before they are trusted (Mono13 5.2, 5.3).

A key frame that divides a clip is only the one in its middle whose patches look most like the first
frame's: it may show an open mouth that the detector misses, and as a key frame would spoil all frames near
it. So its landmarks are corrected themselves, by eq. 4 as any frame's, with flow from the `given` and
`neutral` key frames before and after. Over a long way flow's confidence fades and the detector stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from vermilion.landmarks.correction import (
    FlowPoints,
    LandmarkCorrectionSettings,
    blend_points,
    flow_trust,
    join_ways,
    rough_shapes,
)
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.flow import FaceFlow
from vermilion.landmarks.key_frames import BETWEEN, KeyFrames
from vermilion.landmarks.lip_side import off_lips, onto_lips
from vermilion.landmarks.scheme import N_LANDMARKS
from vermilion.storage.frames import readable


def correct_key_frames(
    read_grey: Callable[[int], np.ndarray],
    track: LandmarkTrack,
    keys: KeyFrames,
    settings: LandmarkCorrectionSettings | None = None,
) -> KeyFrames:
    """The key frames with points of those `between` corrected by flow from the others.

    Images are read twice, once each way, and none is kept: a clip may be a whole take.

    Args:
        read_grey: display brightness (h, w) in [0, 1] of a frame; may raise InputError.
        track: detected landmarks of the whole take, without the offset from the given ones.
        keys: of the same take.
    """
    settings = settings or LandmarkCorrectionSettings()
    between = keys.kinds == BETWEEN
    key_rows = np.searchsorted(track.frames, keys.frames)
    ends, wanted = key_rows[~between], key_rows[between]
    if not len(ends) or not len(wanted):
        return keys
    trusted = dict(zip(ends.tolist(), keys.points_px[~between], strict=True))
    shapes = rough_shapes(track, keys)
    points = np.full((len(wanted), N_LANDMARKS, 2), np.nan)
    confidence = np.zeros(points.shape[:2])
    clip_of, pieces = np.searchsorted(ends, wanted), track.pieces
    for clip, number in sorted(set(zip(clip_of.tolist(), pieces[wanted].tolist(), strict=True))):
        at = (clip_of == clip) & (pieces[wanted] == number)
        rows, spans = wanted[at], []
        # Flow does not lead across a cut.
        if clip > 0 and pieces[ends[clip - 1]] == number:
            spans.append(range(ends[clip - 1], rows[-1] + 1))
        if clip < len(ends) and pieces[ends[clip]] == number:
            spans.append(range(ends[clip], rows[0] - 1, -1))
        if not spans:
            continue
        ways = [
            _carried(read_grey, track, span, trusted[span.start], rows, shapes, settings)
            for span in spans
        ]
        start, end = spans[0].start, spans[-1].start
        later = (rows - start) / (end - start) if len(spans) == 2 else None
        points[at], confidence[at] = join_ways(ways, later)
    flow = FlowPoints(points, confidence)
    settled = keys.points_px.copy()
    nobody = np.zeros(len(wanted), dtype=bool)
    settled[between] = blend_points(track, wanted, flow, nobody, settings).points_px
    return replace(keys, points_px=settled)


def _carried(
    read_grey: Callable[[int], np.ndarray],
    track: LandmarkTrack,
    way: Iterable[int],
    points_px: np.ndarray,
    wanted: np.ndarray,
    shapes: np.ndarray,
    settings: LandmarkCorrectionSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 66, 2) of the first row of a way in n wanted rows of it, and trust (n, 66)."""
    engine, points, astray = FaceFlow(settings.face_px), onto_lips(points_px), np.zeros(N_LANDMARKS)
    found = np.zeros((len(wanted), N_LANDMARKS, 2))
    sure = np.zeros(found.shape[:2])
    last = last_row = None
    for row, grey in readable(way, lambda row: read_grey(int(track.frames[row]))):
        if last is not None:
            flow = engine.between(last, grey, shapes[last_row], shapes[row])
            points, off = flow.carry(points)
            astray = astray + off
        last, last_row = grey, row
        if row in wanted:
            found[wanted == row] = off_lips(points)
            sure[wanted == row] = flow_trust(astray, shapes[row], settings)
    return found, sure
