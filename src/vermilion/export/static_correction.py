"""What of a correction is the person: lips of their own, which are no expression.

A rig's shapes are displacements from a neutral. Measured from the model's neutral, corrected lips differ from it by
their person as well, and weights that are to explain both open a mouth that is shut. With d_f the corrected mesh
of frame f, B the track's shapes and w_f its weights, the person is d_f of the frame in which the actor shows the
neutral, without what shapes away from the lips do there. Where no such frame is known, it is the mean of d_f - B w_f
over the frames: the mean expression stays that of the track, and what the correction adds to the weights is motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.export.animation import Animation

#: A shape belongs to the mouth where it moves a lip by this share of its largest displacement: blinks and brows do not.
_MOVES_LIPS = 0.2


def static_correction(animation: Animation, valid: np.ndarray | None = None) -> np.ndarray:
    """The mean offset (V, 3) of a sequence from what the track's named shapes give, head frame, mm.

    Args:
        animation: of V vertices.
        valid: (F,) bool, frames that were corrected; None: all that have a mesh. Zero where there is none.
    """
    total, count = np.zeros_like(animation.neutral_mm, dtype=np.float64), 0
    for row in animation.rows:
        if valid is None or valid[row]:
            total += _offset(animation, row, animation.shapes.weights[row])
            count += 1
    return total / max(count, 1)


def on_own_neutral(
    animation: Animation,
    lips: np.ndarray,
    valid: np.ndarray | None = None,
    neutral_frame: int | None = None,
) -> Animation:
    """The animation whose neutral is the corrected person's.

    Args:
        animation: of V vertices.
        lips: (V,) bool, the vermilion.
        valid: (F,) bool as in `static_correction`.
        neutral_frame: number of a frame in which the actor shows the neutral; None, or one that is not valid: by the
            mean.
    """
    found = np.flatnonzero(animation.frames == neutral_frame)
    rows = [int(k) for k in found if k in animation.rows and (valid is None or valid[k])]
    if rows:
        of_mouth = moves_lips(animation.shapes.shapes_mm, lips)
        weights = np.where(of_mouth, 0.0, animation.shapes.weights[rows[0]])
        own = animation.neutral_mm + _offset(animation, rows[0], weights)
    else:
        own = animation.neutral_mm + static_correction(animation, valid)
    return replace(animation, neutral_mm=own)


def moves_lips(shapes_mm: np.ndarray, lips: np.ndarray) -> np.ndarray:
    """(K,) bool, which of shapes_mm (K, V, 3) are of the mouth, whose vermilion is lips (V,) bool."""
    lengths = np.linalg.norm(shapes_mm, axis=2)
    return lengths[:, lips].max(axis=1) > _MOVES_LIPS * lengths.max(axis=1)


def _offset(animation: Animation, row: int, weights: np.ndarray) -> np.ndarray:
    """Offset (V, 3) of a frame from the neutral with these weights (K,) of the named shapes, head frame, mm."""
    known = animation.neutral_mm + np.tensordot(weights, animation.shapes.shapes_mm, axes=1)
    world = np.asarray(animation.vertices_mm[row], dtype=np.float64)
    return animation.head.to_head(row, world) - known
