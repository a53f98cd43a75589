"""One face of a take, chosen and followed: linked over time, never replaced by another, cuts apart.

Between two cuts (`cuts`) faces are linked to chains by place and size. One chain of each piece is the face:
the largest, or the one that is asked for. In frames without it there is no face, whoever else is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.landmarks.cuts import find_cuts, pieces_of
from vermilion.landmarks.faces import SeenFaces
from vermilion.landmarks.persons import other_persons
from vermilion.landmarks.scheme import EYE_CORNERS
from vermilion.storage.arrays import read_arrays, write_arrays

NOT_FOUND = "no face found"
#: How far a face moves from one frame to the next, and after a gap, in its sizes; how much it grows (log).
_STEP, _STEP_LATER, _PER_FRAME = 0.6, 1.0, 0.05
_GROWTH, _GROWTH_LATER, _GROWTH_PER_FRAME = 0.35, 0.6, 0.02
#: Chains with less than this share of the weight of the best are passing detections.
_PASSING = 0.2
#: The line of the eyes of a face that counts as upright is turned by at most this (degrees).
_UPRIGHT_DEG = 50.0


@dataclass(frozen=True)
class FaceChoice:
    """Which of several faces is followed: the largest, unless a point or a box says otherwise.

    Attributes:
        point_px: (x, y), the face nearest to it.
        box_px: (left, top, right, bottom), the largest face with its middle inside.
        least_eyes_px: a face whose eyes are nearer to each other, at the sharpness of the image, is too small.
        person_difference: faces of two pieces whose shapes differ by more are two people's (eye distances).
    """

    point_px: tuple[float, ...] = ()
    box_px: tuple[float, ...] = ()
    least_eyes_px: float = 16.0
    person_difference: float = 0.028

    @classmethod
    def of(
        cls, values: Sequence[float], least_eyes_px: float, person_difference: float
    ) -> FaceChoice:
        """Of `values`: none, the largest face; two, a point; four, a box."""
        given = tuple(float(v) for v in values)
        point, box = (given if len(given) == count else () for count in (2, 4))
        return cls(point, box, least_eyes_px, person_difference)

    def __str__(self) -> str:
        if self.point_px:
            return "the one nearest to ({:g}, {:g})".format(*self.point_px)
        if self.box_px:
            return "the largest in the box ({:g}, {:g}, {:g}, {:g})".format(*self.box_px)
        return "the largest"


@dataclass(frozen=True)
class FollowedFace:
    """The face of every frame of a take.

    Attributes:
        frames: (F,) int frame numbers.
        piece: (F,) int, which piece between cuts a frame belongs to, counted from 0.
        face: (F,) int, place of the face among those found in its frame; -1 where it is not there.
        valid: (F,) bool, whether the face is there and can be used.
        reason: (F,) str, why not, or what a user should know of the frame.
        eyes_px: (F,) distance of its outer eye corners; NaN where it is not there.
        n_faces: (F,) int, faces in the frame.
    """

    frames: np.ndarray
    piece: np.ndarray
    face: np.ndarray
    valid: np.ndarray
    reason: np.ndarray
    eyes_px: np.ndarray
    n_faces: np.ndarray

    def sentences(self) -> list[str]:
        """What the log says: pieces, the frames with the face, and every remark where it begins."""
        n_pieces, n_valid = len(np.unique(self.piece)), np.count_nonzero(self.valid)
        told = [f"{n_pieces} piece(s), the face in {n_valid} of {len(self.frames)} frames"]
        last = ""
        for frame, reason in zip(self.frames, self.reason, strict=True):
            if reason and reason != last:
                told.append(f"frame {frame}: {reason}")
            last = reason
        return told

    def table(self) -> list[dict]:
        """A row a frame."""
        names = tuple(self.__dataclass_fields__)
        columns = (getattr(self, name) for name in names)
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> FollowedFace:
        """Read what `save` wrote."""
        return cls(**read_arrays(path, "file of the followed face", cls.__dataclass_fields__))


def follow_face(seen: SeenFaces, choice: FaceChoice, one_shot: bool = False) -> FollowedFace:
    """Choose and follow one face.

    Args:
        seen: faces of all frames of a take.
        choice: which face.
        one_shot: the take has no cuts (a rig that records through).
    """
    n = len(seen.frames)
    if one_shot:
        piece = np.zeros(n, dtype=np.int64)
    else:
        piece = pieces_of(n, find_cuts(seen.looks))
        piece = pieces_of(n, find_cuts(seen.looks, _jumps(seen, _followed(seen, piece, choice))))
    row = _followed(seen, piece, choice)
    differences = other_persons(seen, row, piece, choice.person_difference)
    return _told(seen, piece, row, differences, choice)


def _followed(seen: SeenFaces, piece: np.ndarray, choice: FaceChoice) -> np.ndarray:
    """Row (F,) of the face in each frame among the M faces; -1 where it is not there."""
    row = np.full(len(seen.frames), -1, dtype=np.int64)
    for number in np.unique(piece):
        frames = np.flatnonzero(piece == number)
        chains = _chains(seen, frames)
        best = _chosen(seen, chains, choice)
        for at in chains[best] if best is not None else []:
            row[np.searchsorted(seen.frames, seen.frame[at])] = at
    return row


def _chains(seen: SeenFaces, rows: np.ndarray) -> list[list[int]]:
    """The faces of a piece, frames at `rows` (n,), linked by place and size: lists of faces, in time."""
    chains: list[list[int]] = []
    for frame in seen.frames[rows]:
        here = np.flatnonzero(seen.frame == frame).tolist()
        links = []
        for number, chain in enumerate(chains):
            for face in here:
                cost = _step(seen, chain[-1], face)
                if cost is not None:
                    links.append((cost, number, face))
        taken: set[int] = set()
        grown: set[int] = set()
        for _, number, face in sorted(links):
            if number not in grown and face not in taken:
                chains[number].append(face)
                grown.add(number)
                taken.add(face)
        chains += [[face] for face in here if face not in taken]
    return chains


def _step(seen: SeenFaces, last: int, face: int) -> float | None:
    """How much of a step it is from one face to another in a later frame; None: too far."""
    gap = seen.frame[face] - seen.frame[last] - 1
    size = 0.5 * (seen.size_px[last] + seen.size_px[face])
    moved = np.linalg.norm(seen.centre_px[face] - seen.centre_px[last]) / size
    grown = abs(np.log(seen.size_px[face] / seen.size_px[last]))
    if moved > min(_STEP + _PER_FRAME * gap, _STEP_LATER):
        return None
    if grown > min(_GROWTH + _GROWTH_PER_FRAME * gap, _GROWTH_LATER):
        return None
    return float(moved + 0.5 * grown + 0.02 * min(gap, 50))


def _chosen(seen: SeenFaces, chains: list[list[int]], choice: FaceChoice) -> int | None:
    """Which of some chains is the face; None where no face is in the box."""
    if not chains:
        return None
    weight = np.array([(seen.sureness[c] * seen.size_px[c] ** 2).sum() for c in chains])
    centre = np.array([np.median(seen.centre_px[c], axis=0) for c in chains])
    if choice.box_px:
        left, top, right, bottom = choice.box_px
        x, y = centre.T
        inside = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
        return int(np.argmax(np.where(inside, weight, -1.0))) if inside.any() else None
    if choice.point_px:
        away = np.linalg.norm(centre - choice.point_px, axis=1)
        return int(np.argmin(np.where(weight >= _PASSING * weight.max(), away, np.inf)))
    return int(np.argmax(weight))


def _jumps(seen: SeenFaces, row: np.ndarray) -> np.ndarray:
    """By how much the face (F,), row of each frame, moved from the frame before, in its sizes.

    Infinite where it is lost while others are there, NaN where nothing is known.
    """
    jumps = np.full(len(row), np.nan)
    both = (row[1:] >= 0) & (row[:-1] >= 0)
    a, b = row[:-1][both], row[1:][both]
    moved = np.linalg.norm(seen.centre_px[b] - seen.centre_px[a], axis=1)
    moved = np.hypot(moved, seen.size_px[b] - seen.size_px[a]) / seen.size_px[a]
    jumps[1:][both] = moved
    crowded = np.isin(seen.frames, seen.frame)
    lost = (row[1:] < 0) & (row[:-1] >= 0) & crowded[1:]
    jumps[1:][lost] = np.inf
    return jumps


def _told(
    seen: SeenFaces,
    piece: np.ndarray,
    row: np.ndarray,
    differences: dict[int, float],
    choice: FaceChoice,
) -> FollowedFace:
    """The result, with a reason for each frame that needs one."""
    count = np.array([np.count_nonzero(seen.frame == frame) for frame in seen.frames])
    first_of = np.searchsorted(seen.frame, seen.frames)
    there = row >= 0
    eyes = (
        np.where(there, seen.eyes_px[row], np.nan) if len(seen.frame) else np.full(len(row), np.nan)
    )
    sharp = np.where(there, seen.sharp_eyes_px[row], np.nan) if len(seen.frame) else eyes
    valid, reasons = there.copy(), []
    starts, turned = np.flatnonzero(np.diff(piece, prepend=-1)), _turned(seen, piece, row)
    for at in range(len(row)):
        told = []
        if at in starts[1:]:
            told.append(f"a cut: piece {piece[at] + 1} begins")
        if not there[at]:
            others = f"; {count[at]} other face(s) are not taken for it" if count[at] else ""
            told.append((str(seen.reasons[at]) or NOT_FOUND) + others)
        elif piece[at] in differences:
            valid[at] = False
            told.append(
                f"another person than in the first piece (shapes differ by {differences[piece[at]]:.3f} eye "
                f"distances, more than {choice.person_difference:g}): give these frames a take of another "
                "subject, or raise landmarks.following.person_difference"
            )
        elif sharp[at] < choice.least_eyes_px:
            valid[at] = False
            told.append(_too_small(eyes[at], sharp[at], choice.least_eyes_px))
        if there[at] and at in starts and count[at] > 1:
            told.append(f"{count[at]} faces: {choice} is followed")
        if at in turned:
            told.append(turned[at])
        reasons.append("; ".join(told))
    return FollowedFace(
        seen.frames,
        piece,
        np.where(there, row - first_of, -1),
        valid,
        np.array(reasons, dtype=str),
        eyes,
        count,
    )


def _turned(seen: SeenFaces, piece: np.ndarray, row: np.ndarray) -> dict[int, str]:
    """Frame's place -> what is told of a piece, from there on, whose face is not upright in the image."""
    told = {}
    for number in np.unique(piece):
        at = np.flatnonzero((piece == number) & (row >= 0))
        if not len(at):
            continue
        x, y = np.median(np.diff(seen.shape[row[at]][:, EYE_CORNERS, :2], axis=1)[:, 0], axis=0)
        degrees = float(np.degrees(np.arctan2(y, x)))
        if abs(degrees) > _UPRIGHT_DEG:
            turn = "hflip,vflip" if abs(degrees) > 135 else f"transpose={1 if degrees < 0 else 2}"
            told[int(at[0])] = (
                f"the face is turned by {abs(degrees):.0f} degrees in the image, and landmarks of such faces "
                f"are off by millimetres: turn it upright, `ffmpeg -i in.mp4 -vf {turn} -crf 12 out.mp4`"
            )
    return told


def _too_small(eyes_px: float, sharp_px: float, least_px: float) -> str:
    if eyes_px < least_px:
        return f"the face is too small: eyes {eyes_px:.0f} px apart, at least {least_px:g} px are needed"
    return (
        f"the face is too blurred: eyes {eyes_px:.0f} px apart are worth {sharp_px:.0f} px, at least "
        f"{least_px:g} px are needed"
    )
