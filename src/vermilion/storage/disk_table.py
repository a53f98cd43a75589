"""A large table of numbers on disk, written by rows and read by columns, or the other way round."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from vermilion.storage.unwritable import explain

_ITEM = np.dtype("<f4")


class DiskTable:
    """A table (R, C) float32 of which memory holds the row or the block of columns that is asked for alone.

    The file has no name: it is gone when the table is, also after a kill. It is read and written, not mapped, since
    mapped pages count as memory of the process.
    """

    def __init__(self, rows: int, columns: int, block: int, folder: str | Path | None = None):
        """An empty table.

        Args:
            rows, columns: its shape.
            block: columns of a block, which lie together in the file.
            folder: of the file; None: the system's folder of temporary files, which may be memory.
        """
        self.shape = (rows, columns)
        self._folder = Path(folder or tempfile.gettempdir())
        edges = np.append(np.arange(0, columns, max(block, 1)), columns)
        #: The blocks' columns.
        self.blocks = [slice(int(a), int(b)) for a, b in pairwise(edges)]
        self._file = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115 (as long as the table)

    def write_row(self, row: int, values: np.ndarray) -> None:
        """Set a row to `values` (C,)."""
        for block in self.blocks:
            self._write(self._place(row, block), values[block])

    def write_block(self, block: slice, values: np.ndarray) -> None:
        """Set the columns of a block to `values` (R, c); fewer rows: the first ones."""
        self._write(self._place(0, block), values)

    def row(self, row: int) -> np.ndarray:
        """A row (C,) that was written."""
        values = np.empty(self.shape[1], _ITEM)
        for block in self.blocks:
            self._read(self._place(row, block), values[block])
        return values

    def block(self, block: slice) -> np.ndarray:
        """The columns (R, c) of a block that was written."""
        values = np.empty((self.shape[0], block.stop - block.start), _ITEM)
        self._read(self._place(0, block), values)
        return values

    def read_blocks(self) -> Iterator[tuple[slice, np.ndarray]]:
        """Blocks one by one: their columns, and what they hold (R, c)."""
        for block in self.blocks:
            yield block, self.block(block)

    def _place(self, row: int, block: slice) -> int:
        width = block.stop - block.start
        return _ITEM.itemsize * (block.start * self.shape[0] + row * width)

    def _write(self, place: int, values: np.ndarray) -> None:
        try:
            self._file.seek(place)
            self._file.write(np.ascontiguousarray(values, _ITEM).data)
        except OSError as error:
            told = explain(error, self._folder / "temporary file")
            if told is error:
                raise
            raise told from error

    def _read(self, place: int, into: np.ndarray) -> None:
        self._file.seek(place)
        if self._file.readinto(into.data.cast("B")) != into.nbytes:
            raise ValueError("a part of the table that was not written")
