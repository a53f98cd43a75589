"""The sequence that a file of another tracker holds, and what is wrong with one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.geometry.polygons import Polygons
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class RawSequence:
    """Meshes of one topology, in the file's own unit.

    Attributes:
        frames: (F,) int numbers, those asked for.
        vertices: (F, V, 3) float64, world, the file's unit; NaN for a frame that is lost.
        polygons: as the file has them.
        unit_mm: length of the unit that the file names; None: it names none.
        up: axis that the file names as up, `y` or `z`; None: it names none.
        lost: frame -> why it is lost.
        facts: what was understood of the file, sentences.
    """

    frames: np.ndarray
    vertices: np.ndarray
    polygons: Polygons
    unit_mm: float | None = None
    up: str | None = None
    lost: dict[int, str] = field(default_factory=dict)
    facts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Request:
    """What is read of which file.

    Attributes:
        path: file or folder.
        frames: numbers of the frames.
        fps: frames a second, for files that count seconds; None: the file's own rate.
        mesh: path of the mesh in the file; None: the one that moves.
        place: subject and take, for error messages.
        flame: the user's FLAME model, for sequences of its parameters; None: none.
    """

    path: Path
    frames: Sequence[int]
    fps: float | None = None
    mesh: str | None = None
    place: dict[str, Any] = field(default_factory=dict)
    flame: Path | None = None

    def error(self, found: str, expected: str, hint: str, **more: Any) -> InputError:
        """The error of this file."""
        return InputError(found, expected, hint, **{"path": self.path, **self.place, **more})

    def only(self, found: Sequence[Any], names: Sequence[str]) -> Any:
        """The one mesh of those `found` in a file whose meshes are `names`. Raises InputError for none or several."""
        if len(found) != 1:
            raise self.error(
                f"{len(found)} meshes of {list(names)}",
                "one mesh, the face",
                "Name it in `tracking.external.mesh`.",
            )
        return found[0]

    def absent(self, present: Iterable[int]) -> dict[int, str]:
        """Frames that the file does not have, with the reason.

        Args:
            present: frames that it has.

        Raises:
            InputError: it has none of those asked for.
        """
        known = set(present)
        lost = [frame for frame in self.frames if frame not in known]
        if lost and len(lost) == len(self.frames):
            span = f"frames {min(known)} to {max(known)}" if known else "no numbered frames"
            raise self.error(
                span,
                f"frame {lost[0]}" if len(lost) == 1 else f"frames {lost[0]} to {lost[-1]}",
                "Correct `first` and `last` of the take sheet, or export the frames.",
                frame=lost[0],
            )
        return dict.fromkeys(lost, f"not in {self.path.name}")


def filled(frames: Sequence[int], meshes: dict[int, np.ndarray]) -> np.ndarray:
    """Vertices (F, V, 3) of the frames, of `meshes` frame -> (V, 3); NaN where there is none."""
    shape = next(iter(meshes.values())).shape
    result = np.full((len(frames), *shape), np.nan)
    for row, frame in enumerate(frames):
        if frame in meshes:
            result[row] = meshes[frame]
    return result
