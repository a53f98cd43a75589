"""The lips of a tracked mesh as the image has them: what contour detectors start from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.features.occluding import OccludingContour
from vermilion.features.rings import Ring, lip_rings
from vermilion.geometry.camera import Camera


@dataclass(frozen=True)
class TrackedLips:
    """Contours of one topology; build it once.

    Attributes:
        outer, inner: rings of n samples on the mesh.
        occluding: what hides the mouth, which the inner ring need not be.
    """

    outer: Ring
    inner: Ring
    occluding: OccludingContour

    @classmethod
    def of(cls, model: FaceModel, n_samples: int = 80) -> TrackedLips:
        """On the lips of a face model."""
        return cls(*lip_rings(model, n_samples), OccludingContour.of(model))

    def rings_px(self, vertices_mm: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Outer and inner ring (n, 2) px of a mesh `vertices_mm` (V, 3), world.

        Sample 0 is the right corner of the mouth, n / 2 the left one, the upper lip between.
        """
        outer, inner = (
            camera.project(ring.points(vertices_mm)) for ring in (self.outer, self.inner)
        )
        lips = camera.project(self.occluding.on(vertices_mm))
        known = np.ones(len(inner), dtype=bool)
        samples, points, _ = self.occluding.match(lips, outer, inner, known)
        inner[samples] = lips[points]
        return outer, inner
