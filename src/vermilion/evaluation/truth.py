"""Known truth of a take: the meshes of some frames and the curves that made them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vermilion.storage.arrays import read_array
from vermilion.storage.errors import InputError
from vermilion.storage.json_files import load_json
from vermilion.storage.sequences import read_sequence

_HINT = "Correct the folder that evaluation.truth names, or leave the key empty."


def read_truth(
    vertices: str | Path, triangles: str | Path, rows: np.ndarray, **place
) -> tuple[np.ndarray, np.ndarray]:
    """Meshes (F, S, 3) mm of the true sequence and their triangles (T, 3).

    Args:
        vertices: `vertices_mm.npy` (all frames, S, 3), the take's first frame first.
        triangles: `triangles.npy`.
        rows: (F,) places of the wanted frames in the take.
        place: subject and take, for messages.

    Raises:
        InputError: a file that cannot be read, fewer frames than the take, triangles of other
            vertices.
    """
    sequence = read_sequence(vertices)
    _check_length(len(sequence), rows, vertices, place)
    corners = read_array(triangles, "triangles", **place)
    if corners.ndim != 2 or corners.shape[1] != 3 or corners.max(initial=0) >= sequence.shape[1]:
        raise InputError(
            f"triangles {corners.shape} with vertices up to {corners.max(initial=0)}",
            f"(triangles, 3) of {sequence.shape[1]} vertices",
            _HINT,
            path=triangles,
            **place,
        )
    return sequence[rows], corners


def read_curves(path: str | Path, rows: Iterable[int], **place) -> list[dict[str, float]]:
    """Expression weights of the frames at `rows` of the take, a dict each."""
    try:
        curves = load_json(path)
    except (OSError, ValueError) as error:
        raise InputError(
            f"unreadable curves ({error})", "a JSON list of {curve: weight}, one a frame", _HINT,
            path=path, **place,
        ) from error  # fmt: skip
    _check_length(len(curves), rows, path, place)
    return [curves[int(row)] for row in rows]


def _check_length(found: int, rows: Iterable[int], path: str | Path, place: dict) -> None:
    wanted = max((int(row) for row in rows), default=-1) + 1
    if found < wanted:
        raise InputError(
            f"truth of {found} frames",
            f"at least {wanted}, the take's first frame first",
            _HINT,
            path=path,
            **place,
        )
