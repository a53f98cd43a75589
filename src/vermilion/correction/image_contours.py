"""What the image says of the lips: lines that the contours of a mesh must project on.

A found contour point fixes the mesh along the contour's normal only: where along the contour a
sample belongs is not seen, nor its depth.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from vermilion.contours.curves import smoothed_ring
from vermilion.faces.model import FaceModel
from vermilion.features.search import inward_normals
from vermilion.geometry.camera import Camera

#: What an image takes from feature files.
IMAGE_ARRAYS = ("outer_px", "inner_px", "outer_found", "inner_found", "valid")


@dataclass(frozen=True)
class ImageContourSettings:
    """How the image counts; all at 0 or False: not at all, which is the paper.

    Attributes:
        repose: whether the corrected head is laid on the image again.
        repose_frames: deviation of the symmetric filter over time of that motion, frames.
        contour_weight: of a millimetre of contour beside the mesh's stiffness.
        contour_robust_mm: a contour point this far off counts half.
        closed: lips touch where the inner contour is lower than this, per inter-ocular distance.
        contact: whether lips that touch in the image meet, and never pass through each other.
    """

    repose: bool = True
    repose_frames: float = 3.0
    contour_weight: float = 1.0
    contour_robust_mm: float = 2.5
    closed: float = 0.012
    contact: bool = True

    @property
    def used(self) -> bool:
        return self.repose or self.contour_weight > 0 or self.contact


@dataclass(frozen=True)
class ImageContours:
    """Lip contours in the images of some frames.

    Attributes:
        face: the model that the mesh is of, for its contours and landmarks.
        camera: of the images.
        frames: (F,) frame numbers.
        outer_px, inner_px: (F, n, 2) rings of points, sample k found from sample k of the mesh.
        outer_found, inner_found: (F, n) bool.
        settings: how all this counts.
    """

    face: FaceModel
    camera: Camera
    frames: np.ndarray
    outer_px: np.ndarray
    inner_px: np.ndarray
    outer_found: np.ndarray
    inner_found: np.ndarray
    settings: ImageContourSettings = field(default_factory=ImageContourSettings)

    @classmethod
    def of(
        cls,
        face: FaceModel,
        camera: Camera,
        frames: np.ndarray,
        features: dict[str, np.ndarray],
        settings: ImageContourSettings,
    ) -> ImageContours:
        """Of the arrays `IMAGE_ARRAYS` of feature files; in a frame that is not valid nothing is found."""
        valid = features["valid"][:, None]
        return cls(
            face, camera, np.asarray(frames), features["outer_px"], features["inner_px"],
            features["outer_found"] & valid, features["inner_found"] & valid, settings,
        )  # fmt: skip

    def __getitem__(self, chosen: np.ndarray) -> ImageContours:
        """The same of some frames, by rows or (F,) bool."""
        names = ("frames", "outer_px", "inner_px", "outer_found", "inner_found")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(points (F, 2n, 2) px, unit normals (F, 2n, 2), known (F, 2n) bool), outer ring first."""
        outer, inner = (
            _ring_lines(*ring)
            for ring in ((self.outer_px, self.outer_found), (self.inner_px, self.inner_found))
        )
        return tuple(np.concatenate(parts, axis=1) for parts in zip(outer, inner, strict=True))


def frames_around(frames: np.ndarray, known: np.ndarray, reach: int) -> np.ndarray:
    """Those of the `known` frame numbers that lie within `reach` of one of `frames`, ascending."""
    apart = np.abs(np.subtract.outer(np.sort(known), np.asarray(frames)))
    return np.sort(known)[apart.min(axis=1) <= reach]


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
