"""A corrected sequence as blend shapes: the base track's named ones, and correctives for the rest.

What the named shapes do not explain is split into its mean and its principal components, as many as
the tolerance asks for. All weights lie in [0, 1], since rigs and importers clamp others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from vermilion.export.animation import Animation, NamedShapes

_GROWTH = 1.15  # of the number of components between two tries
_RMS = 0.4  # of a coordinate, as a share of the tolerance, at the first try
_BLOCK = 2048  # coordinates that are summed at once
_SAMPLED = 2500  # vertices, at least, by which frames are compared
_STILL = 0.25  # share of the tolerance below which a vertex needs no corrective


@dataclass(frozen=True)
class ShapeBasis:
    """Blend shapes that give back a sequence.

    Attributes:
        neutral_mm: (V, 3) head frame, float32.
        shapes: named shapes and correctives; weights in [0, 1] of the rows.
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
        return self.neutral_mm + np.tensordot(weights, self.shapes.shapes_mm, axes=1)

    def on_other_topology(
        self, matrix: sparse.spmatrix, neutral_mm: np.ndarray, expressions_mm: np.ndarray
    ) -> ShapeBasis:
        """The same basis on another mesh that follows this one linearly.

        Args:
            matrix: (W, V) what the mesh takes of a displacement of this one.
            neutral_mm: (W, 3) its neutral, head frame.
            expressions_mm: (K, W, 3) its own named shapes, which replace the first K.
        """
        carried = [matrix @ shape for shape in self.shapes.shapes_mm[len(expressions_mm) :]]
        shapes = (
            np.concatenate([np.asarray(expressions_mm, np.float32), np.array(carried, np.float32)])
            if carried
            else np.asarray(expressions_mm, np.float32)
        )
        return replace(
            self,
            neutral_mm=np.asarray(neutral_mm, np.float32),
            shapes=replace(self.shapes, shapes_mm=shapes),
        )


def shape_basis(animation: Animation, tolerance_mm: float) -> ShapeBasis:
    """Named shapes of the animation and the correctives that bring it within `tolerance_mm`.

    The tolerance is of the farthest vertex of all frames. Frames without a mesh are left out.
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

    # Twice through the take, so that memory holds the vertices that need correctives alone.
    farthest = np.zeros(len(neutral))
    for index in range(len(rows)):
        np.maximum(farthest, np.linalg.norm(left(index), axis=1), out=farthest)
    needed = farthest > _STILL * tolerance_mm
    moved, error = np.flatnonzero(needed), float(farthest[~needed].max(initial=0.0))
    if len(moved):
        flat = np.empty((len(rows), 3 * len(moved)), dtype=np.float32)
        for index in range(len(rows)):
            flat[index] = left(index)[moved].ravel()
        extra, extra_weights, found = _correctives(flat, tolerance_mm)
        del flat  # the largest array
        together = np.zeros((len(shapes) + len(extra), *neutral.shape), dtype=np.float32)
        together[: len(shapes)] = shapes
        together[len(shapes) :, moved] = extra.reshape(len(extra), -1, 3)
        shapes = together
        weights = np.concatenate([weights, extra_weights], axis=1)
        error = max(error, found)
    n_extra = len(shapes) - len(named.names)
    names = (*named.names, *(f"corrective_{k:03d}" for k in range(n_extra)))
    return ShapeBasis(neutral, NamedShapes(names, shapes, weights), rows, error)


def _correctives(flat: np.ndarray, tolerance_mm: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Shapes (k, N), weights (F, k) in [0, 1] and the largest error (mm) of `flat` (F, N), which is centred."""
    mean = flat.mean(axis=0, dtype=np.float64).astype(np.float32)
    flat -= mean
    gram = np.zeros((len(flat), len(flat)))
    # Some vertices tell how frames are alike; what comes of it is measured at all.
    step = 3 * max(1, flat.shape[1] // (3 * _SAMPLED))
    told = np.flatnonzero(np.arange(flat.shape[1]) % step < 3)
    for start in range(0, len(told), _BLOCK):
        block = flat[:, told[start : start + _BLOCK]].astype(np.float64)
        gram += block @ block.T
    gram *= flat.shape[1] / max(len(told), 1)
    values, vectors = np.linalg.eigh(gram)
    values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
    left = np.sqrt(np.maximum(values.sum() - np.cumsum(values), 0) / flat.size)
    # Where the RMS of a coordinate is so small, the largest error of a vertex is near the tolerance.
    count = int(np.argmax(left <= _RMS * tolerance_mm)) + 1 if values[0] > 0 else 0
    while True:
        used = vectors[:, :count]
        single = used.astype(np.float32)  # or the product would be made of a copy in double
        table = np.empty((count + 1, flat.shape[1]), dtype=np.float32)
        shapes = np.matmul(single.T, flat, out=table[1:])
        error = _largest(flat, single, shapes)
        if error <= tolerance_mm or count >= len(flat):
            break
        count = min(len(flat), int(np.ceil(count * _GROWTH)))
    low, high = used.min(axis=0, initial=0.0), used.max(axis=0, initial=0.0)
    span = np.where(high > low, high - low, 1.0)
    table[0] = mean + low.astype(np.float32) @ shapes
    weights = np.concatenate([np.ones((len(flat), 1)), (used - low) / span], axis=1)
    shapes *= span[:, None].astype(np.float32)
    return table, weights, error


def _largest(flat: np.ndarray, used: np.ndarray, shapes: np.ndarray) -> float:
    """Largest distance of a vertex between `flat` (F, 3 V) and used (F, k) @ shapes (k, 3 V)."""
    worst = 0.0
    step = 3 * _BLOCK
    for start in range(0, flat.shape[1], step):
        off = flat[:, start : start + step] - used @ shapes[:, start : start + step]
        distance = np.sqrt((off.reshape(len(flat), -1, 3) ** 2).sum(axis=2))
        worst = max(worst, float(distance.max()))
    return worst
