"""Pose of the head of a corrected sequence, which the correction may have moved (`correction.image.repose`)."""

from __future__ import annotations

import numpy as np

from vermilion.export.animation import Animation, HeadFrame
from vermilion.geometry.alignment import similarity_alignment

_LEAST = 3


def corrected_pose(animation: Animation, steady: np.ndarray) -> HeadFrame:
    """The rigid motion of each frame that takes the track's own mesh onto the animation's.

    Without it, shapes and rigs would have to show a motion of the whole head.

    Args:
        animation: with the pose of the track.
        steady: (V,) bool, vertices that hardly move with expression and that are not corrected.

    Returns:
        the pose; that of the track in frames without a mesh, or where there are fewer than three vertices.
    """
    head, shapes, neutral = animation.head, animation.shapes, animation.neutral_mm[steady]
    rotation, translation = head.rotation.copy(), head.translation_mm.copy()
    for row in animation.rows if steady.sum() >= _LEAST else ():
        known = neutral + np.tensordot(shapes.weights[row], shapes.shapes_mm[:, steady], axes=1)
        world = np.asarray(animation.vertices_mm[row], dtype=np.float64)[steady]
        found = similarity_alignment(known, world, scale=1.0)
        rotation[row], translation[row] = found.rotation, found.translation
    return HeadFrame(rotation, translation)
