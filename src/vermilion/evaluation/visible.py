"""Which reference points the cameras of a rig see, frame by frame, in truth."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vermilion.evaluation.reference import Reference
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster


def cameras_that_see(
    reference: Reference, cameras: Iterable[Camera], vertices: np.ndarray
) -> np.ndarray:
    """How many cameras see each reference point, (F, V) int; hidden by the true surface or not.

    Args:
        cameras: of the rig, in the reference's world.
        vertices: (V,) bool: which points to ask for; the others are seen by none.
    """
    ids = np.flatnonzero(vertices & reference.valid)
    counts = np.zeros(reference.points_mm.shape[:2], dtype=int)
    for frame, points in enumerate(reference.points_mm[:, ids]):
        caster = RayCaster(reference.vertices_mm[frame], reference.triangles)
        counts[frame, ids] = sum(caster.visible(camera, points) for camera in cameras)
    return counts
