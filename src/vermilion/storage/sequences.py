"""Mesh sequences: (frames, vertices, 3) float32 `.npy` beside one topology `.ply`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vermilion.storage.arrays import DAMAGE, write_array
from vermilion.storage.errors import InputError


def write_sequence(path: str | Path, vertices_mm: np.ndarray) -> None:
    """Write `vertices_mm` (F, V, 3) as float32 `.npy`."""
    if vertices_mm.ndim != 3 or vertices_mm.shape[2] != 3:
        raise ValueError(f"a sequence must be (F, V, 3), got {vertices_mm.shape}")
    write_array(path, np.ascontiguousarray(vertices_mm, dtype=np.float32))


def read_sequence(paths: str | Path | Sequence[str | Path]) -> np.ndarray:
    """Read one chunk (memory-mapped) or join several, (F, V, 3) float32, mm."""
    if isinstance(paths, str | Path):
        return _open_sequence(paths)
    return np.concatenate([_open_sequence(path) for path in paths])


def _open_sequence(path: str | Path) -> np.ndarray:
    try:
        vertices = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(vertices, np.ndarray):
            raise ValueError("several arrays")
    except DAMAGE as error:
        raise InputError(
            f"an unreadable mesh sequence ({error})",
            "a .npy of (frames, vertices, 3)",
            "Remove the file and run again.",
            path=path,
        ) from error
    if vertices.ndim != 3 or vertices.shape[2] != 3:
        raise InputError(
            f"an array of shape {vertices.shape}",
            "(frames, vertices, 3)",
            "Give a mesh sequence.",
            path=path,
        )
    return vertices


def frames_of(paths: Sequence[str | Path]) -> np.ndarray:
    """Frame numbers (F,) of chunk files `<first>-<last>.<suffix>` in their order."""
    spans = [[int(number) for number in Path(path).stem.split("-")] for path in paths]
    return np.concatenate([np.arange(first, last + 1) for first, last in spans])


def rows_of_frames(
    paths: Sequence[str | Path], frames: Sequence[int]
) -> dict[int, tuple[str | Path, int]]:
    """Frame number -> (chunk file `<first>-<last>.<suffix>`, its row there)."""
    wanted = {int(frame) for frame in frames}
    return {
        int(frame): (path, row)
        for path in paths
        for row, frame in enumerate(frames_of([path]))
        if int(frame) in wanted
    }
