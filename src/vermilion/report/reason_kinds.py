"""Flagged frames by the kind of their reason: one row, however the figures in the reason differ.

    inner edge 1.3 to 17.1 times as rough as the base track's       55 frames: 0-12, 20, ...

A reason that names several faults counts for each of them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import pandas as pd

from vermilion.report.page import spans

_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?!\w)")
#: Ranges of frames of a row; a long take may have thousands.
_MOST_SPANS = 24
#: What a reason says -> what to do about it. docs/howto/bad_take.md explains each of them.
REMEDIES = (
    ("times as rough as", "step through these frames at the mouth; where the edge looks as in the frames beside, keep them"),
    ("flipped or folded", "look at the mouth; the contours pull the mesh: see contours/overlay"),
    ("inner mouth in front", "look at the mouth; the contours pull the mesh: see contours/overlay"),
    ("outside the training", "look at these frames; capture more of such expressions, or sketch some of them"),
    ("turned by", "turn the video upright, as the reason says, and run again"),
    ("the face is too", "use a larger or sharper video of the face"),
    ("no face found", "see landmarks/overlay: is a face in the image?"),
    ("other face(s)", "name the face that is meant: landmarks.following"),
    ("is followed", "name the face that is meant: landmarks.following"),
    ("another person", "give these frames a take of another subject"),
    ("a cut", "nothing, where the video is cut there"),
    ("landmarks miss the model", "see tracking/overlay: is the head where the mesh is?"),
    ("no landmarks", "mend what the landmarks say of these frames"),
    ("not tracked", "mend what the landmarks and the tracking say of these frames"),
    ("no contour", "mend what the contours say of these frames"),
    ("outer contour found", "see contours/overlay: draw contour labels of a frame or two in this light"),
    ("no outer contour", "see contours/overlay: draw contour labels of a frame or two in this light"),
    ("not followed", "see features/overlay; the lips stay with the track there"),
    ("labels lie", "look at the labels of these frames"),
    ("label left out", "look at the labels of these frames"),
    ("mouth is outside", "nothing, where the mouth leaves the image"),
    ("unreadable", "export these images again"),
)  # fmt: skip


@dataclass(frozen=True)
class FlaggedKind:
    """Frames of a stage with the same kind of reason.

    Attributes:
        stage: as in quality.tsv.
        state: `not usable` or `warning`.
        count: number of frames.
        which: their numbers, as ranges.
        reason: with the range of each figure.
        remedy: what to do; empty where the reason says it itself.
    """

    stage: str
    state: str
    count: int
    which: str
    reason: str
    remedy: str


@dataclass
class _Group:
    """Frames of one kind of reason, and the texts of each of its figures."""

    frames: list[int] = field(default_factory=list)
    figures: list[tuple[str, ...]] = field(default_factory=list)


def by_kind(flagged: pd.DataFrame) -> list[FlaggedKind]:
    """One entry for each stage, state and kind of reason, in the order of the rows.

    Args:
        flagged: columns stage, frame, valid, reason.
    """
    groups: dict[tuple[str, str, str], _Group] = {}
    for row in flagged.to_dict("records"):
        state = "warning" if row["valid"] else "not usable"
        for part in parts_of("" if pd.isna(row["reason"]) else str(row["reason"])):
            key = (str(row["stage"]), state, _NUMBER.sub("\0", part))
            group = groups.setdefault(key, _Group())
            group.frames.append(int(row["frame"]))
            group.figures.append(tuple(_NUMBER.findall(part)))
    found = []
    for (stage, state, kind), group in groups.items():
        ranges = [_range(texts) for texts in zip(*group.figures, strict=True)]
        start, *pieces = kind.split("\0")
        reason = start + "".join(r + p for r, p in zip(ranges, pieces, strict=True))
        count, which = len(set(group.frames)), shortened_spans(group.frames)
        found.append(FlaggedKind(stage, state, count, which, reason, remedy_of(reason)))
    return found


def parts_of(reason: str) -> list[str]:
    """The faults that a reason names; a sentence with what was expected is one."""
    return [reason] if "; expected " in reason else reason.split("; ")


def remedy_of(reason: str) -> str:
    """What to do about a kind of reason; empty where the reason says it itself."""
    return next((remedy for said, remedy in REMEDIES if said in reason), "")


def shortened_spans(frames: Sequence[int]) -> str:
    """`0-12, 20, ...` of frame numbers."""
    ranges = spans(frames).split(", ")
    more = len(ranges) - _MOST_SPANS
    return ", ".join(ranges[:_MOST_SPANS]) + (f" and {more} more ranges" if more > 0 else "")


def _range(texts: Sequence[str]) -> str:
    least, most = min(texts, key=float), max(texts, key=float)
    return least if float(least) == float(most) else f"{least} to {most}"
