"""Some frames of what lies in chunk files `<first>-<last>.<suffix>`, in the order asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import read_sequence, rows_of_frames


def read_frames(paths: Sequence[str | Path], frames: Sequence[int]) -> np.ndarray:
    """Meshes (F, V, 3) float32, mm, of `.npy` chunks at frame numbers (F,)."""
    places = _places(paths, frames)
    meshes = {path: read_sequence(path) for path in paths}
    first = next(iter(meshes.values()))
    result = np.empty((len(places), *first.shape[1:]), dtype=first.dtype)
    for index, (path, row) in enumerate(places):
        result[index] = meshes[path][row]
    return result


def read_chunks(
    paths: Sequence[str | Path], frames: Sequence[int], names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Named arrays, first axis frames, of `.npz` chunks at frame numbers (F,)."""
    places = _places(paths, frames)
    used = {path for path, _ in places} or set(paths[:1])
    parts = {path: read_arrays(path, "file of a chunk", names) for path in used}
    return {
        name: np.stack([parts[path][name][row] for path, row in places])
        if places
        else next(iter(parts.values()))[name][:0]
        for name in names
    }


def _places(paths: Sequence[str | Path], frames: Sequence[int]) -> list[tuple[str | Path, int]]:
    """File and row of each frame; raises InputError where a frame is in no file."""
    found = rows_of_frames(paths, frames)
    missing = [int(frame) for frame in frames if int(frame) not in found]
    if missing:
        raise InputError(
            f"no chunk with frame {missing[0]} among {len(paths)} files",
            "every frame of the take",
            "Run the stage that writes them again.",
            path=Path(paths[0]).parent if len(paths) else None,
        )
    return [found[int(frame)] for frame in frames]
