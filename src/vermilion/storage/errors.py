"""The few exceptions that Vermilion raises on purpose.

Each message says where (subject, take, camera, frame, file), what was found, what was expected
and what to do.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any


class VermilionError(Exception):
    """Base of every error that a user can act upon."""


def describe_problem(
    found: str,
    expected: str,
    hint: str,
    *,
    subject: str | None = None,
    take: str | None = None,
    camera: str | None = None,
    frame: int | None = None,
    path: str | Path | None = None,
) -> str:
    """Compose the one-paragraph message that all errors share."""
    place = [
        f"{name} {value}"
        for name, value in (
            ("subject", subject),
            ("take", take),
            ("camera", camera),
            ("frame", frame),
            ("file", path),
        )
        if value is not None
    ]
    where = ", ".join(place)
    prefix = f"{where}: " if where else ""
    return f"{prefix}found {found}; expected {expected}. {hint}"


class PlacedError(VermilionError):
    """An error that names its place: what was found there, what was expected, what to do."""

    def __init__(self, found: str, expected: str, hint: str, **place: Any) -> None:
        self.brief = found
        super().__init__(describe_problem(found, expected, hint, **place))


class InputError(PlacedError):
    """A file or value that the user gave cannot be used."""


class RefusedInputError(InputError):
    """A file that is whole, but of a kind that is not read; the message says how to convert it."""


class ForbiddenInputError(PlacedError):
    """A file that may not be read: no fault of the file, so that no frame is given up for it."""


class ConfigurationError(VermilionError):
    """The configuration or the take sheet is wrong; lists every problem at once."""

    def __init__(self, problems: list[str]):
        self.problems = list(problems)
        lines = "\n".join(f"  {i + 1}. {p}" for i, p in enumerate(self.problems))
        super().__init__(f"{len(self.problems)} problem(s) in the configuration:\n{lines}")


class ModelFileError(PlacedError):
    """A model file is damaged, too new, or made for another topology."""
