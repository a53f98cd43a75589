"""The take sheet: one row a take, every row checked."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal, cast, get_args

from vermilion.config.frame_range import frame_range
from vermilion.config.sheet_cells import COLUMNS, OPTIONAL_COLUMNS, read_cells
from vermilion.config.sheet_numbers import eye_distance_of, face_of, focal_of
from vermilion.storage.errors import InputError

Role = Literal["tattoo", "plain", "video", "tracked"]
#: Largest number of a frame: results are named by six digits.
MOST_FRAME = 999_999
#: What a split may be.
SPLIT = r"train|test|none|test:\d+-\d+(,\d+-\d+)*"
#: `source` of a take that the studio makes.
STUDIO = "studio"


@dataclass(frozen=True)
class Take:
    """A row of the take sheet.

    Attributes:
        subject, take: names, letters, digits, `_` and `.` only.
        role: `tattoo`, `plain`, `video` or `tracked`.
        source: capture folder, frame folder, video file or single image; `studio` for the embedded default.
        first, last: frame numbers, both included. The first frame shows the neutral. Left empty in the
            sheet, they are those of the source on disk.
        fps: frames a second.
        split: `train`, `test`, `none`, or `test:A-B,C-D` (these stretches of frames are held out, the
            rest trains).
        face: which of several faces is followed: none, (x, y) or (left, top, right, bottom), pixels.
        focal: known focal length of a single camera, in lengths of the image's longer side; None: not known.
        of: take of the same subject whose images a `tracked` sequence was tracked in; it has that take's
            frames and is its base. Empty: none.
        eye_distance_mm: measured distance of the subject's pupils, in any of their rows; None: not known.
    """

    subject: str
    take: str
    role: Role
    source: str
    first: int
    last: int
    fps: float
    split: str
    face: tuple[float, ...] = ()
    focal: float | None = None
    of: str = ""
    eye_distance_mm: float | None = None

    @property
    def name(self) -> str:
        return f"{self.subject}/{self.take}"

    @property
    def frames(self) -> range:
        return range(self.first, self.last + 1)

    @property
    def is_multiview(self) -> bool:
        return self.role in ("tattoo", "plain")

    def held_out(self, frame: int) -> bool:
        """Whether no regressor may train on this frame."""
        if self.split.startswith("test:"):
            return any(low <= frame <= high for low, high in stretches(self.split))
        return self.split != "train"

    def test_frames(self) -> list[int]:
        """Frames that the evaluation measures: held out of training, of a take with a test split."""
        return [] if self.split == "none" else list(_held_out(self)[0])

    def train_frames(self) -> list[int]:
        return list(_held_out(self)[1])


@cache
def _held_out(take: Take) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Frames of a take that are held out, and the others. The workflow asks for them for many jobs."""
    if take.split.startswith("test:"):
        ranges = stretches(take.split)
    else:
        ranges = [] if take.split == "train" else [(take.first, take.last)]
    held = {frame for low, high in ranges for frame in range(low, high + 1)}
    parts: tuple[list[int], list[int]] = ([], [])
    for frame in take.frames:
        parts[frame not in held].append(frame)
    return tuple(parts[0]), tuple(parts[1])


def eye_distances(takes: Sequence[Take]) -> dict[str, float]:
    """Subject -> measured distance of the pupils (mm), of those for whom a row has one."""
    return {take.subject: take.eye_distance_mm for take in takes if take.eye_distance_mm}


def stretches(split: str) -> list[tuple[int, int]]:
    """First and last frame of each held-out stretch of a split `test:A-B,C-D`."""
    return [
        (int(low), int(high))
        for low, high in (part.split("-") for part in split.removeprefix("test:").split(","))
    ]


def read_takes(path: str | Path) -> tuple[list[Take], list[str]]:
    """Read the sheet; returns the good rows and a sentence for each problem (none raised)."""
    path = Path(path)
    try:
        rows, problems = read_cells(path)
    except (OSError, ValueError) as error:
        return [], [
            f"{path}: found no readable take sheet ({getattr(error, 'strerror', error)}); expected a TSV with "
            f"columns {' '.join(COLUMNS)}. Create it or correct the key `takes`."
        ]
    if problems:
        return [], problems
    takes = []
    for number, row in enumerate(rows, start=1):
        take, wrong = _parse(row)
        problems += [f"{path}, row {number} ({row['subject']}/{row['take']}): {w}" for w in wrong]
        if take is not None:
            takes.append(take)
    problems += [f"{path}: {problem}" for problem in _check_together(takes)]
    return takes, problems


def _parse(row: dict[str, str]) -> tuple[Take | None, list[str]]:
    value = {name: row.get(name, "") for name in COLUMNS + OPTIONAL_COLUMNS}
    wrong = _word_problems(value)
    numbers: dict[str, float] = {}
    open_ends = [name for name in ("first", "last") if not value[name]]
    for name, kind in (("first", int), ("last", int), ("fps", float)):
        if name in open_ends:
            continue
        try:
            numbers[name] = kind(value[name])
        except ValueError:
            wrong.append(
                f"{name}: found '{value[name]}'; expected "
                f"{'a whole number' if kind is int else 'a number'}."
            )
    if value["of"]:
        numbers |= dict.fromkeys(set(open_ends), 0)  # those of the images come later
    elif open_ends and not wrong:
        numbers, reason = _with_range(value, numbers, open_ends)
        wrong += [reason] if reason else []
    if {"first", "last"} <= numbers.keys() and not (
        0 <= numbers["first"] <= numbers["last"] <= MOST_FRAME
    ):
        wrong.append(
            f"frames: found {numbers['first']} to {numbers['last']}; expected 0 <= first <= last <= "
            f"{MOST_FRAME}."
        )
    if not 0 < numbers.get("fps", 1) < math.inf:
        wrong.append(f"fps: found {numbers['fps']}; expected more than 0 frames a second.")
    split = value["split"] or "none"
    wrong += _split_problems(split, numbers)
    face, reason = face_of(value["face"])
    focal, reason_of_focal = focal_of(value["focal"])
    eyes, reason_of_eyes = eye_distance_of(value["eye_distance_mm"])
    wrong += [text for text in (reason, reason_of_focal, reason_of_eyes) if text]
    if wrong:
        return None, wrong
    take = Take(
        value["subject"],
        value["take"],
        cast(Role, value["role"]),
        value["source"],
        int(numbers["first"]),
        int(numbers["last"]),
        numbers["fps"],
        split,
        face,
        focal,
        value["of"],
        eyes,
    )
    return take, []


def _word_problems(value: dict[str, str]) -> list[str]:
    """What is wrong with the cells that are no numbers."""
    wrong = []
    for name in ("subject", "take"):
        if not re.fullmatch(r"(?!\.)[A-Za-z0-9_.]+", value[name]):
            wrong.append(
                f"{name}: found '{value[name]}'; expected letters, digits, '_' and '.', which does not "
                "come first. Rename it: it becomes a folder."
            )
    if value["role"] not in get_args(Role):
        wrong.append(f"role: found '{value['role']}'; expected one of {', '.join(get_args(Role))}.")
    if not value["source"]:
        wrong.append(
            "source: found nothing; expected a capture folder, a video, an image or `studio`."
        )
    if not value["source"].isprintable():
        wrong.append(
            f"source: found {value['source']!r}; expected a path. Remove what cannot be seen."
        )
    return wrong


def _split_problems(split: str, numbers: dict[str, float]) -> list[str]:
    """What is wrong with a split, beside the numbers of its row."""
    if not re.fullmatch(SPLIT, split):
        return [
            f"split: found '{split}'; expected train, test, none or test:A-B,C-D "
            "(frames A to B and C to D held out)."
        ]
    if not split.startswith("test:") or not {"first", "last"} <= numbers.keys():
        return []
    return [
        f"split: found held-out frames {low} to {high}; expected them within "
        f"{numbers['first']} to {numbers['last']}."
        for low, high in stretches(split)
        if not numbers["first"] <= low <= high <= numbers["last"]
    ]


def _with_range(
    value: dict[str, str], numbers: dict[str, float], open_ends: list[str]
) -> tuple[dict[str, float], str]:
    """The numbers of a row with `first` and `last` of its source; or a sentence why there are none."""
    place = " and ".join(open_ends)
    if value["source"] == STUDIO:
        return numbers, f"{place}: found nothing; expected frame numbers, as the studio makes them."
    try:
        first, last = frame_range(value["source"], value["role"])
    except InputError as error:
        return numbers, f"{place}: found nothing, and of the source: {error}"
    found = {"first": first, "last": last, **numbers}
    if value["role"] == "plain" and "last" in open_ends:
        found["last"] = found["first"]
    return found, ""


def _check_together(takes: list[Take]) -> list[str]:
    problems = []
    names = [take.name for take in takes]
    for name in sorted({n for n in names if names.count(n) > 1}):
        problems.append(
            f"take {name}: found {names.count(name)} rows; expected one. Rename a take."
        )
    for take in takes:
        if take.role == "plain" and len(take.frames) != 1:
            problems.append(
                f"take {take.name}: found {len(take.frames)} frames; expected one frame "
                "without tattoo in a `plain` take. Set `last` to `first`."
            )
        plain = [t for t in takes if t.subject == take.subject and t.role == "plain"]
        if take.role == "tattoo" and len(plain) != 1:
            problems.append(
                f"take {take.name}: found {len(plain)} `plain` takes of subject "
                f"{take.subject}; expected one. Add a row for the frame without tattoo."
            )
    for subject in sorted({take.subject for take in takes}):
        found = sorted(
            {t.eye_distance_mm for t in takes if t.subject == subject and t.eye_distance_mm}
        )
        if len(found) > 1:
            problems.append(
                f"subject {subject}: found eye_distance_mm {' and '.join(f'{d:g}' for d in found)}; "
                "expected one distance a person. Correct or empty one."
            )
    return problems
