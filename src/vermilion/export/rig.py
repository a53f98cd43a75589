"""Weights of a rig that give the corrected lips, and one corrective shape for what it cannot show.

A rig is a set of blend shapes on the sequence's own mesh. Weights lie in [0, 1], few are used at once,
and they change smoothly. Of all frames f with displacements d_f from the neutral they minimise

    sum_f |B w_f - d_f|^2 / n + SPARSE sum_f |w_f|_1 + SMOOTH sum_f |w_f - w_(f-1)|^2

over weighted vertices (n: the sum of their weights), by coordinate descent over shapes, odd and even
frames in turn. The corrective C with its weights c_f in [0, 1] is found in turn with them, d_f - c_f C in the
place of d_f: it takes what no weights of the rig show, most of all the shape of this person's lips.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vermilion.export.animation import Animation, NamedShapes
from vermilion.geometry.mesh_files import MESH_SUFFIXES, read_polygons
from vermilion.storage.errors import InputError
from vermilion.storage.kernels import kernel

SPARSE, SMOOTH = 2e-3, 2e-2  # mm^2 for a weight of 1
_SWEEPS, _SETTLED = 400, 1e-5
_BLOCK = 64  # frames
#: Rounds of weights and corrective in turn, until the lips come nearer by less than this share. Constants, since they
#: trade time alone. Lips that one shape outside the rig moves are 0.070 mm off after the first round, 0.004 after 20
#: and after 80; lips on the far side of one of the rig's shapes 0.32, 0.15 and 0.08 of 1.24 mm. A share of 0.01 ends
#: neither of these earlier.
_ROUNDS, _GAIN = 20, 0.001
LIPS = 6.0  # weight of a vertex of the lips against one of the face
_NEUTRAL = "neutral"


@dataclass(frozen=True)
class RigWeights:
    """A rig's weights of a take, and what is left.

    Attributes:
        frames: (F,) frame numbers with a mesh.
        shapes: names, shapes (K, V, 3) mm and weights (F, K), which go with the corrective.
        alone: (F, K) the best weights without a corrective.
        corrective_mm: (V, 3) the shape that explains most of what the rig does not.
        corrective: (F,) its weights, in [0, 1].
        left_mm: (F,) mean distance over the lips of `alone`; `corrected_mm` with the corrective.
    """

    frames: np.ndarray
    shapes: NamedShapes
    alone: np.ndarray
    corrective_mm: np.ndarray
    corrective: np.ndarray
    left_mm: np.ndarray
    corrected_mm: np.ndarray


def read_rig(folder: str | Path, n_vertices: int) -> NamedShapes:
    """Read a folder with `neutral.obj` and a file a shape, named after it; millimetres.

    Args:
        folder: OBJ, PLY files of one topology.
        n_vertices: of the sequence's mesh, whose vertex order the rig must have.

    Returns:
        shapes (K, V, 3) as displacements from the rig's neutral, no weights (0, K).

    Raises:
        InputError: no neutral, no shape, or another number of vertices.
    """
    folder = Path(folder)
    paths = {p.stem: p for p in sorted(folder.glob("*")) if p.suffix.lower() in MESH_SUFFIXES}
    neutral = paths.pop(_NEUTRAL, None)
    if neutral is None or not paths:
        raise InputError(
            f"{len(paths)} shapes and {'a' if neutral else 'no'} neutral",
            "neutral.obj (or .ply) and a file a shape",
            "Export the rig's neutral and each shape at weight 1.",
            path=folder,
        )
    rest = _vertices(neutral, n_vertices)
    shapes = np.stack([_vertices(path, n_vertices) - rest for path in paths.values()])
    return NamedShapes(tuple(paths), shapes, np.zeros((0, len(paths))))


def _vertices(path: Path, n_vertices: int) -> np.ndarray:
    vertices, _ = read_polygons(path)
    if len(vertices) != n_vertices:
        raise InputError(
            f"{len(vertices)} vertices",
            f"{n_vertices}, those of the exported mesh in its order",
            "Transfer the rig to that mesh (mesh.ply), or set `apply.export.topology`.",
            path=path,
        )
    return vertices


def solve_rig(animation: Animation, rig: NamedShapes, lips: np.ndarray) -> RigWeights:
    """Weights of a rig for the frames of an animation that have a mesh.

    Args:
        animation: of V vertices; its neutral is the rig's at weight 0.
        rig: shapes (K, V, 3), head frame.
        lips: (V,) bool, vertices of the vermilion.

    Returns:
        weights and corrective.
    """
    rows = animation.rows
    moved = np.empty((len(rows), len(lips), 3), dtype=np.float32)
    for index, row in enumerate(rows):
        world = np.asarray(animation.vertices_mm[row], dtype=np.float64)
        moved[index] = animation.head.to_head(row, world) - animation.neutral_mm
    trust = np.where(lips, LIPS, 1.0)
    shapes = np.asarray(rig.shapes_mm, dtype=np.float64)
    scaled = shapes * (trust / trust.sum())[:, None]
    flat = scaled.reshape(len(shapes), -1)
    gram = flat @ shapes.reshape(len(shapes), -1).T
    # A long take of a whole head is large: no copy of it is made in double.
    table = moved.reshape(len(rows), -1)
    blocks = range(0, len(rows), _BLOCK)
    target = np.concatenate([table[start : start + _BLOCK] @ flat.T for start in blocks])
    single = shapes.reshape(len(shapes), -1).astype(np.float32)
    alone = weights = bounded_weights(gram, target)

    def left(weights: np.ndarray) -> np.ndarray:
        known = (weights.astype(np.float32) @ single).reshape(moved.shape)
        return np.subtract(moved, known, out=known)

    rest, off = left(weights), np.inf
    left_mm = np.linalg.norm(rest[:, lips], axis=2).mean(axis=1)
    for _ in range(_ROUNDS):
        corrective_mm, corrective = _one_shape(rest, trust)
        after = rest[:, lips] - corrective[:, None, None] * corrective_mm[lips]
        corrected_mm = np.linalg.norm(after, axis=2).mean(axis=1)
        if not corrected_mm.mean() < (1.0 - _GAIN) * off:
            break
        off, kept = corrected_mm.mean(), (weights, corrective_mm, corrective, corrected_mm)
        shown = np.outer(corrective, flat @ corrective_mm.ravel())
        weights = bounded_weights(gram, target - shown, start=weights)
        rest = left(weights)
    weights, corrective_mm, corrective, corrected_mm = kept
    return RigWeights(
        animation.frames[rows], replace(rig, weights=weights), alone, corrective_mm, corrective,
        left_mm, corrected_mm,
    )  # fmt: skip


def bounded_weights(
    gram: np.ndarray,
    target: np.ndarray,
    sparse: float = SPARSE,
    smooth: float = SMOOTH,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Weights (F, K) in [0, 1] that minimise the energy of this module.

    Args:
        gram: (K, K) products of the shapes.
        target: (F, K) products of the shapes with each frame.
        sparse, smooth: mm^2 for a weight of 1.
        start: (F, K) weights to begin with; None: zero.
    """
    weights = np.zeros(target.shape) if start is None else start.copy()
    gram, target = np.ascontiguousarray(gram), np.ascontiguousarray(target)
    _descend(gram, target, weights, 0.5 * sparse, smooth, _SWEEPS, _SETTLED)
    return weights


@kernel()
def _descend(gram, target, weights, offset, smooth, sweeps, settled):
    """Coordinate descent, in place: a shape at a time, in frames of even row, then of odd row."""
    count, n_shapes = target.shape
    for _ in range(sweeps):
        largest = 0.0
        for k in range(n_shapes):
            for parity in range(2):
                for row in range(parity, count, 2):
                    beside, neighbours = 0.0, 0
                    if row > 0:
                        beside += weights[row - 1, k]
                        neighbours += 1
                    if row < count - 1:
                        beside += weights[row + 1, k]
                        neighbours += 1
                    others = -weights[row, k] * gram[k, k]
                    for other in range(n_shapes):
                        others += weights[row, other] * gram[k, other]
                    high = target[row, k] - others - offset + smooth * beside
                    step = max(gram[k, k] + smooth * neighbours, 1e-12)
                    new = min(max(high / step, 0.0), 1.0)
                    largest = max(largest, abs(new - weights[row, k]))
                    weights[row, k] = new
        if largest < settled:
            break


def _one_shape(rest: np.ndarray, trust: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The shape (V, 3) and weights (F,) in [0, 1] whose product is nearest to `rest` (F, V, 3)."""
    flat = rest.reshape(len(rest), -1)
    repeated = np.repeat(trust, 3)
    weights = np.ones(len(flat))
    for _ in range(50):
        shape = weights.astype(flat.dtype) @ flat / max(float(weights @ weights), 1e-12)
        heavy = shape * repeated
        along = flat @ heavy.astype(flat.dtype)
        weights = np.maximum(along / max(float(shape @ heavy), 1e-12), 0.0).astype(np.float64)
    top = max(float(weights.max(initial=0.0)), 1e-12)
    return (shape * top).reshape(-1, 3).astype(np.float64), weights / top
