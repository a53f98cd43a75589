"""A corrected sequence as blend shapes: the base track's named ones, and correctives for the rest.

What the named shapes do not explain is split into its mean and its principal components, as many as
the tolerance asks for. All weights lie in [0, 1], since rigs and importers clamp others. A take of a whole
head is large: what is split lies on disk, and so do the correctives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import sparse

from vermilion.export.animation import Animation, NamedShapes
from vermilion.storage.disk_table import DiskTable

_GROWTH = 1.15  # of the number of components between two tries
_RMS = 0.4  # of a coordinate, as a share of the tolerance, at the first try
_BLOCK = 1024  # vertices that are looked at at once
_SAMPLED = 2500  # vertices, at least, by which frames are compared
_STILL = 0.25  # share of the tolerance below which a vertex needs no corrective


@dataclass(frozen=True)
class StoredShapes:
    """Blend shapes (K, V, 3) float32 of which memory holds the first ones and the one that is asked for alone.

    Attributes:
        named_mm: (N, V, 3) float32, the first.
        count: of those that follow.
        corrective_mm: gives one of them, (V, 3) float32.
    """

    named_mm: np.ndarray
    count: int
    corrective_mm: Callable[[int], np.ndarray]

    def __len__(self) -> int:
        return len(self.named_mm) + self.count

    def __getitem__(self, k: int) -> np.ndarray:
        """A shape (V, 3), mm."""
        if not 0 <= k < len(self):
            raise IndexError(k)
        first = len(self.named_mm)
        return self.named_mm[k] if k < first else self.corrective_mm(k - first)

    def __iter__(self) -> Iterator[np.ndarray]:
        return (self[k] for k in range(len(self)))


@dataclass(frozen=True)
class ShapeBasis:
    """Blend shapes that give back a sequence.

    Attributes:
        neutral_mm: (V, 3) head frame, float32.
        shapes: named shapes and correctives (`StoredShapes`); weights in [0, 1] of the rows.
        rows: (n,) int, frames of the animation that have a mesh.
        error_mm: largest distance of a vertex to the sequence.
    """

    neutral_mm: np.ndarray
    shapes: NamedShapes
    rows: np.ndarray
    error_mm: float

    def vertices_mm(self, index: int) -> np.ndarray:
        """Vertices (V, 3) of the `index`-th row, head frame, as a reader of the file sums them."""
        weights = self.shapes.weights[index].astype(np.float32)
        result = self.neutral_mm.copy()
        for weight, shape in zip(weights, self.shapes.shapes_mm, strict=True):
            result += weight * shape
        return result

    def on_other_topology(
        self, matrix: sparse.spmatrix, neutral_mm: np.ndarray, expressions_mm: np.ndarray
    ) -> ShapeBasis:
        """The same basis on another mesh that follows this one linearly.

        Args:
            matrix: (W, V) what the mesh takes of a displacement of this one.
            neutral_mm: (W, 3) its neutral, head frame.
            expressions_mm: (K, W, 3) its own named shapes, which replace the first K.
        """
        own, first = self.shapes.shapes_mm, len(expressions_mm)
        carried = StoredShapes(
            np.asarray(expressions_mm, np.float32), len(own) - first,
            lambda k: np.asarray(matrix @ own[first + k], np.float32),
        )  # fmt: skip
        return replace(
            self,
            neutral_mm=np.asarray(neutral_mm, np.float32),
            shapes=replace(self.shapes, shapes_mm=carried),
        )


def shape_basis(
    animation: Animation, tolerance_mm: float, folder: str | Path | None = None
) -> ShapeBasis:
    """Named shapes of the animation and the correctives that bring it within `tolerance_mm`.

    The tolerance is of the farthest vertex of all frames. Frames without a mesh are left out.

    Args:
        animation: the sequence.
        tolerance_mm: see above.
        folder: of the tables that are too large for memory, which go with the result; None: the system's.

    Raises:
        UnwritableError: the folder's disk is full.
    """
    rows = np.array(animation.rows, dtype=int)
    named = animation.shapes
    weights = np.clip(named.weights[rows], 0.0, 1.0)
    shapes = np.asarray(named.shapes_mm, dtype=np.float32)
    neutral = np.asarray(animation.neutral_mm, dtype=np.float32)

    def left(index: int) -> np.ndarray:
        """What the named shapes do not explain of a row, (V, 3) mm."""
        known = neutral + np.tensordot(weights[index].astype(np.float32), shapes, axes=1)
        world = np.asarray(animation.vertices_mm[rows[index]], np.float64)
        return (animation.head.to_head(rows[index], world) - known).astype(np.float32)

    # Twice through the take, so that the table holds the vertices that need correctives alone.
    farthest = np.zeros(len(neutral))
    for index in range(len(rows)):
        np.maximum(farthest, np.linalg.norm(left(index), axis=1), out=farthest)
    needed = farthest > _STILL * tolerance_mm
    moved, error = np.flatnonzero(needed), float(farthest[~needed].max(initial=0.0))
    stored, n_extra = StoredShapes(shapes, 0, shapes.__getitem__), 0
    if len(moved):
        flat = DiskTable(len(rows), 3 * len(moved), 3 * _BLOCK, folder)
        for index in range(len(rows)):
            flat.write_row(index, left(index)[moved].ravel())
        table, n_extra, extra_weights, found = _correctives(flat, tolerance_mm, folder)
        weights = np.concatenate([weights, extra_weights], axis=1)
        error = max(error, found)

        def corrective(k: int) -> np.ndarray:
            shape = np.zeros_like(neutral)
            shape[moved] = table.row(k).reshape(-1, 3)
            return shape

        stored = StoredShapes(shapes, n_extra, corrective)
    names = (*named.names, *(f"corrective_{k:03d}" for k in range(n_extra)))
    return ShapeBasis(neutral, NamedShapes(names, stored, weights), rows, error)


def _correctives(
    flat: DiskTable, tolerance_mm: float, folder: str | Path | None
) -> tuple[DiskTable, int, np.ndarray, float]:
    """Shapes (the first k rows, N), k, weights (F, k) in [0, 1] and the largest error (mm) of `flat` (F, N)."""
    count_frames, size = flat.shape
    values, vectors = np.linalg.eigh(_gram(flat))
    values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
    left = np.sqrt(np.maximum(values.sum() - np.cumsum(values), 0) / (count_frames * size))
    # Where the RMS of a coordinate is so small, the largest error of a vertex is near the tolerance.
    count = int(np.argmax(left <= _RMS * tolerance_mm)) + 1 if values[0] > 0 else 0
    error = _error(flat, vectors[:, :count], tolerance_mm)
    while error > tolerance_mm and count < count_frames:
        count = min(count_frames, int(np.ceil(count * _GROWTH)))
        error = _error(flat, vectors[:, :count], tolerance_mm)
    used = vectors[:, :count]
    low, high = used.min(axis=0, initial=0.0), used.max(axis=0, initial=0.0)
    span = np.where(high > low, high - low, 1.0)
    weights = np.concatenate([np.ones((count_frames, 1)), (used - low) / span], axis=1)
    table = DiskTable(count + 1, size, 3 * _BLOCK, folder)
    single = used.astype(np.float32)
    for block, values in flat.read_blocks():
        mean = _centre(values)
        shapes = single.T @ values
        first = mean + low.astype(np.float32) @ shapes
        shapes *= span[:, None].astype(np.float32)
        table.write_block(block, np.concatenate([first[None], shapes]))
    return table, count + 1, weights, error


def _centre(values: np.ndarray) -> np.ndarray:
    """The mean (c,) of `values` (F, c), which is taken off them."""
    mean = values.mean(axis=0, dtype=np.float64).astype(np.float32)
    values -= mean
    return mean


def _gram(flat: DiskTable) -> np.ndarray:
    """Products (F, F) of the centred frames. Some vertices tell them; what comes of it is measured at all."""
    count, size = flat.shape
    gram, told = np.zeros((count, count)), 0
    step = 3 * max(1, size // (3 * _SAMPLED))
    for block, values in flat.read_blocks():
        chosen = values[:, np.arange(block.start, block.stop) % step < 3].astype(np.float64)
        chosen -= chosen.mean(axis=0)
        gram += chosen @ chosen.T
        told += chosen.shape[1]
    return gram * (size / max(told, 1))


def _error(flat: DiskTable, used: np.ndarray, enough_mm: float) -> float:
    """Largest distance (mm) of a vertex between the centred frames and what components used (F, k) give of them.

    Where it is over `enough_mm`, one that is over it too.
    """
    single, worst = used.astype(np.float32), 0.0  # or products would be made of a copy in double
    for _, values in flat.read_blocks():
        _centre(values)
        values -= single @ (single.T @ values)
        offsets = values.reshape(len(values), -1, 3)
        squared = np.einsum("fvc,fvc->fv", offsets, offsets)
        worst = max(worst, float(np.sqrt(squared.max())))
        if worst > enough_mm:
            break
    return worst
