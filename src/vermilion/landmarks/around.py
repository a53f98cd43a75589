"""The followed face in frames around a short take: those of its source before and after it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vermilion.landmarks.detector import Landmarks, LandmarkTrack
from vermilion.landmarks.faces import FaceFinds, SeenFaces
from vermilion.landmarks.following import FaceChoice, FollowedFace, follow_face
from vermilion.storage.frames import evenly_taken


def frames_around_take(
    take: tuple[int, int], source: tuple[int, int], span: int, count: int
) -> list[int]:
    """Numbers of frames before and after a take, so that with it they span `span` frames of its source.

    The take lies in their middle, or as near to it as the ends of the source allow.

    Args:
        take, source: first and last frame of each.
        span: frames; a take as long has none around it.
        count: how many frames stand for all of these, evenly taken.
    """
    first, last = take
    n_frames = last - first + 1
    if n_frames >= span:
        return []
    low = min(first - (span - n_frames) // 2, source[1] - span + 1)
    low = max(low, source[0])
    high = min(low + span - 1, source[1])
    step = max((high - low + 1) // count, 1)
    before, after = range(first - step, low - 1, -step), range(last + step, high + 1, step)
    return [*reversed(before), *after]


def track_around(
    finds: FaceFinds, own: SeenFaces, followed: FollowedFace, choice: FaceChoice
) -> LandmarkTrack:
    """Landmarks of a take's face in the frames around it; not valid where it is not there or behind a cut.

    Args:
        finds: all faces of the frames around.
        own: faces of the take.
        followed: which of them is followed.
        choice: how it was chosen.
    """
    step = int(np.diff(finds.frames).min()) if len(finds.frames) > 1 else 1
    anchors = _anchors(followed, step)
    face = np.full(len(finds.frames), -1)
    if len(finds.frames) and anchors:
        seen = SeenFaces.joined([finds.seen(), own.of_frames(anchors)])
        face = _face_of(follow_face(seen, choice), followed, anchors, finds.frames)
    entries = [
        faces[at] if at >= 0 else Landmarks.none(finds.landmark_set)
        for faces, at in zip(finds.faces, face, strict=True)
    ]
    return LandmarkTrack.of(finds.frames.tolist(), entries, landmark_set=finds.landmark_set)


def _anchors(followed: FollowedFace, step: int) -> list[int]:
    """Frames of a take with its face, about `step` apart as those around it: changes stay alike."""
    frames = followed.frames[followed.valid]
    return sorted(evenly_taken(frames, max(len(frames) // step, 1)) if len(frames) else [])


def _face_of(
    all_of_them: FollowedFace, followed: FollowedFace, anchors: Sequence[int], frames: np.ndarray
) -> np.ndarray:
    """Place (F,) of the face among those of each of the `frames` (F,) around; -1 where it is not there.

    It counts in pieces between cuts in which the face of the take's own frames is the one that is followed there.
    """
    known = dict(zip(followed.frames.tolist(), followed.face.tolist(), strict=True))
    rows = {frame: row for row, frame in enumerate(all_of_them.frames.tolist())}
    own = [rows[frame] for frame in anchors]
    same = [
        row
        for frame, row in zip(anchors, own, strict=True)
        if all_of_them.face[row] == known[frame]
    ]
    right = set(all_of_them.piece[same]) - set(all_of_them.piece[np.setdiff1d(own, same)])
    here = [rows[frame] for frame in frames.tolist()]
    there = all_of_them.valid & np.isin(all_of_them.piece, list(right))
    return np.where(there[here], all_of_them.face[here], -1)
