"""Image-space lip contours: lines that the contours of a mesh must project on.

A found contour point fixes the mesh along the contour's normal only: where along the contour a
sample belongs is not seen, nor its depth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from vermilion.contours.curves import inward_normals, smoothed_ring
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera

#: Arrays of the feature files that image-space contours are made of.
IMAGE_ARRAYS = ("outer_px", "inner_px", "outer_found", "inner_found", "valid")


@dataclass(frozen=True)
class ImageContours:
    """Lip contours in the images of some frames.

    Attributes:
        face: the model that the mesh is of, for its contours and landmarks.
        camera: of the images.
        outer_px: (F, n, 2) ring of points, sample k found from sample k of the mesh.
        inner_px: (F, n, 2), likewise.
        outer_found: (F, n) bool.
        inner_found: (F, n) bool.
    """

    face: FaceModel
    camera: Camera
    outer_px: np.ndarray
    inner_px: np.ndarray
    outer_found: np.ndarray
    inner_found: np.ndarray

    @classmethod
    def of(
        cls, face: FaceModel, camera: Camera, measured: Mapping[str, np.ndarray]
    ) -> ImageContours:
        """From `measured`, IMAGE_ARRAYS: rings (F, n, 2) px, found (F, n) and valid (F,) bool.

        In a frame that is not valid nothing counts as found.
        """
        valid = measured["valid"][:, None]
        outer_found, inner_found = measured["outer_found"] & valid, measured["inner_found"] & valid
        return cls(
            face, camera, measured["outer_px"], measured["inner_px"], outer_found, inner_found
        )

    def __getitem__(self, rows: np.ndarray | slice) -> ImageContours:
        """The same of some frames, by rows or (F,) bool."""
        names = (f.name for f in fields(self) if f.name not in ("face", "camera"))
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(points (F, 2n, 2) px, unit normals (F, 2n, 2), known (F, 2n) bool), outer ring first."""
        outer = _ring_lines(self.outer_px, self.outer_found)
        inner = _ring_lines(self.inner_px, self.inner_found)
        points, normals, known = (np.concatenate(p, axis=1) for p in zip(outer, inner, strict=True))
        return points, normals, known


def _ring_lines(
    rings_px: np.ndarray, found: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`ImageContours.lines` of one kind of ring, (F, n, 2) and (F, n)."""
    known = found & np.isfinite(rings_px).all(axis=2)
    points, normals = np.nan_to_num(rings_px), np.zeros(rings_px.shape)
    for f, ring in enumerate(points):
        normals[f] = inward_normals(smoothed_ring(ring, 2))
    return points, normals, known & ~_turning(points)


def _turning(rings_px: np.ndarray) -> np.ndarray:
    """(F, n) bool: where rings (F, n, 2) run back on themselves, as at the corner of a closed mouth."""
    back, ahead = rings_px - np.roll(rings_px, 1, axis=1), np.roll(rings_px, -1, axis=1) - rings_px
    product = np.linalg.norm(back, axis=2) * np.linalg.norm(ahead, axis=2)
    return (back * ahead).sum(axis=2) < 0.3 * product
