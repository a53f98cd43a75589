"""Mesh sequences: (frames, vertices, 3) float32 `.npy` beside one topology `.ply`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from vermilion.storage.arrays import DAMAGE, write_array
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path


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


def write_frames(
    path: str | Path, shape: tuple[int, int, int], frames: Iterable[np.ndarray]
) -> None:
    """Write a sequence of `shape` (F, V, 3) as float32 `.npy` from its `frames` (V, 3), one at a time in memory.

    Raises:
        ValueError: another number of frames or vertices.
    """
    header = {"descr": "<f4", "fortran_order": False, "shape": shape}
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, header)
        count = 0
        for vertices in frames:
            if vertices.shape != shape[1:]:
                raise ValueError(f"a frame of shape {vertices.shape} in a sequence of {shape}")
            stream.write(np.ascontiguousarray(vertices, dtype="<f4").data)
            count += 1
        if count != shape[0]:
            raise ValueError(f"{count} frames in a sequence of {shape}")


class StreamedSequence:
    """A sequence on disk, (F, V, 3) float32, of which memory holds the frame that is asked for alone.

    Pages of a memory-mapped file count as memory of the process until the system takes them back.
    """

    def __init__(self, path: str | Path):
        """Open a `.npy`.

        Raises:
            InputError: no sequence.
        """
        self.shape = _open_sequence(path).shape
        with open(path, "rb") as stream:
            np.lib.format.read_magic(stream)
            shape, fortran, kind = np.lib.format.read_array_header_1_0(stream)
            self._start = stream.tell()
        if fortran or kind != np.dtype("<f4"):
            raise InputError(
                f"values of type {kind}", "float32, frame after frame", "Run again.", path=path
            )
        self._path, self._frame_bytes = Path(path), 4 * int(np.prod(shape[1:]))

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, row: int) -> np.ndarray:
        """The vertices (V, 3) of a frame."""
        if not -len(self) <= row < len(self):
            raise IndexError(row)
        with open(self._path, "rb") as stream:
            stream.seek(self._start + int(row % len(self)) * self._frame_bytes, os.SEEK_SET)
            return np.frombuffer(stream.read(self._frame_bytes), "<f4").reshape(self.shape[1:])


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
