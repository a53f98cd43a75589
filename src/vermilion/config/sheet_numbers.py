"""Numbers in the cells of the take sheet: which face, which lens, how large a head."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence

#: Distances of pupils that people have (mm), with room on either side.
EYE_DISTANCE_MM = (30.0, 100.0)


def face_of(text: str) -> tuple[tuple[float, ...], str]:
    """The numbers of the column `face`, and a sentence where they are none."""
    try:
        numbers = [float(part) for part in text.split(",")] if text else []
    except ValueError:
        return (), f"face: found '{text}'; expected numbers separated by commas, or nothing."
    return tuple(numbers), face_problem(numbers)


def focal_of(text: str) -> tuple[float | None, str]:
    """The number of the column `focal`, and a sentence where it is none."""
    try:
        focal = float(text) if text else None
    except ValueError:
        focal = math.nan
    if focal is None or 0.3 <= focal <= 10:
        return focal, ""
    return None, (
        f"focal: found '{text}'; expected the focal length over the length of the image's longer side, "
        "0.3 to 10 (millimetres of a full-frame lens over 36), or nothing."
    )


def eye_distance_of(text: str) -> tuple[float | None, str]:
    """The number of the column `eye_distance_mm`, and a sentence where it is none."""
    if not text:
        return None, ""
    reason = eye_distance_problem(text)
    return (None, f"eye_distance_mm: {reason}") if reason else (float(text), "")


def eye_distance_problem(text: str) -> str:
    """What is wrong with a measured distance of the pupils; empty where nothing is."""
    with contextlib.suppress(ValueError):
        if EYE_DISTANCE_MM[0] <= float(text) <= EYE_DISTANCE_MM[1]:
            return ""
    return (
        f"found '{text}'; expected the distance of the pupils in millimetres, {EYE_DISTANCE_MM[0]:g} to "
        f"{EYE_DISTANCE_MM[1]:g} (adults 54 to 74)."
    )


def face_problem(numbers: Sequence[float]) -> str:
    """What is wrong with the numbers that say which face is followed; empty where nothing is."""
    if len(numbers) not in (0, 2, 4) or not all(math.isfinite(number) for number in numbers):
        return (
            f"face: found {len(numbers)} numbers; expected nothing (the largest), x, y (the nearest to "
            "a point) or left, top, right, bottom (the largest in a box), in pixels."
        )
    if len(numbers) == 4 and not (numbers[0] < numbers[2] and numbers[1] < numbers[3]):
        return "face: found an empty box; expected left < right and top < bottom."
    return ""
