"""The interface of contour detectors: likelihood maps of the inner and the outer contour."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from vermilion.contours.labels import CONTOURS
from vermilion.contours.region import MouthRegion, mouth_region
from vermilion.storage.arrays import write_arrays

FORMAT_VERSION = 4


class ContourDetector(ABC):
    """Finds lip contours in each image by itself, so that chunks do not matter.

    Attributes:
        interocular_size_px: inter-ocular distance of the region that is looked at.
        margin: of the region round the mouth, per inter-ocular distance.
    """

    #: What the file calls it.
    kind: ClassVar[str]
    #: Whether it needs rings of the lips to start from: of the track, or of dense landmarks.
    from_track: ClassVar[bool] = False
    #: Whether it starts from such rings where there are any.
    takes_rings: ClassVar[bool] = False
    interocular_size_px: float
    margin: float

    def region(
        self, landmarks_px: np.ndarray, lips_px: tuple[np.ndarray, np.ndarray] | None = None
    ) -> MouthRegion:
        """The mouth's region of a frame, with the rings that the detector starts from.

        Args:
            landmarks_px: (66, 2); lips_px: rings (n, 2), as in `likelihood`.
        """
        lips = lips_px if self.takes_rings else None
        return mouth_region(landmarks_px, self.interocular_size_px, self.margin, lips_px=lips)

    def likelihood(
        self,
        linear_rgb: np.ndarray,
        landmarks_px: np.ndarray,
        lips_px: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Likelihood maps (inner, outer), both (h, w) float32 in [0, 1], zero far from the mouth.

        Args:
            linear_rgb: (h, w, 3) float32 image.
            landmarks_px: (66, 2) of the face in it.
            lips_px: rings (n, 2), outer and inner, of the tracked lips (`features.tracked_lips`) or of
                dense landmarks (`contours.landmark_rings`).
        """
        region = self.region(landmarks_px, lips_px)
        maps = self.region_likelihood(region.crop(linear_rgb), region)
        inner, outer = (region.paste(maps[name], linear_rgb.shape[:2]) for name in CONTOURS)
        return inner, outer

    @abstractmethod
    def region_likelihood(self, image: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Name of the contour -> likelihood (size, size) of a cropped region.

        Args:
            image: (size, size, 3) linear RGB.
            region: where it was cropped, with the rings to start from.
        """

    @abstractmethod
    def arrays(self) -> dict[str, np.ndarray | float]:
        """All that the detector is, by name: plain arrays, of whatever shape (n, ...), and numbers."""

    @classmethod
    @abstractmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> Self:
        """Of what `arrays` gave, each (n, ...) or (). Raises KeyError where something is missing."""

    def save(self, path: str | Path) -> None:
        """Write `.npz` of plain arrays, whole or not at all."""
        header = {"format_version": FORMAT_VERSION, "kind": self.kind}
        write_arrays(path, compressed=True, **header, **self.arrays())
