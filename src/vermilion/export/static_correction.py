"""What of a correction stands still in a take: the person's own lips, which are no expression.

A rig's shapes are displacements from a neutral. Measured from the model's neutral, corrected lips differ from it by
their person as well, and weights that are to explain both open a mouth that is shut. With d_f the corrected mesh
of frame f, B the track's shapes and w_f its weights, the person is the mean of d_f - B w_f over the frames: the mean
expression stays that of the track, and what the correction adds to the weights is motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.export.animation import Animation


def static_correction(animation: Animation, valid: np.ndarray | None = None) -> np.ndarray:
    """The mean offset (V, 3) of a sequence from what the track's named shapes give, head frame, mm.

    Args:
        animation: of V vertices.
        valid: (F,) bool, frames that were corrected; None: all that have a mesh. Zero where there is none.
    """
    total, count = np.zeros_like(animation.neutral_mm, dtype=np.float64), 0
    for row in animation.rows:
        if valid is not None and not valid[row]:
            continue
        shapes = animation.shapes
        known = animation.neutral_mm + np.tensordot(shapes.weights[row], shapes.shapes_mm, axes=1)
        world = np.asarray(animation.vertices_mm[row], dtype=np.float64)
        total += animation.head.to_head(row, world) - known
        count += 1
    return total / max(count, 1)


def on_own_neutral(animation: Animation, valid: np.ndarray | None = None) -> Animation:
    """The animation whose neutral is the corrected person's; `valid` (F,) as in `static_correction`."""
    own = animation.neutral_mm + static_correction(animation, valid)
    return replace(animation, neutral_mm=own)
