"""What finds lip contours: one interface, likelihood maps of the inner and the outer contour."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np

from vermilion.contours.boosting import Forest
from vermilion.contours.channels import CHANNELS, image_channels, integral_images
from vermilion.contours.labels import CONTOURS
from vermilion.contours.pool import FeaturePool
from vermilion.contours.region import MouthRegion, mouth_region
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import ModelFileError

FORMAT_VERSION = 1


class ContourDetector(ABC):
    """Finds lip contours in each image by itself, so that chunks do not matter.

    Attributes:
        interocular_size_px: inter-ocular distance of the region that is looked at.
        margin: of the region round the mouth, per inter-ocular distance.
    """

    #: What the file calls it.
    kind: ClassVar[str]
    #: Whether it starts from the lips of the track, and not from the landmarks'.
    from_track: ClassVar[bool] = False
    interocular_size_px: float
    margin: float

    def region(
        self, landmarks_px: np.ndarray, lips_px: tuple[np.ndarray, np.ndarray] | None = None
    ) -> MouthRegion:
        """The mouth's region of a frame, with the rings that the detector starts from."""
        lips = lips_px if self.from_track else None
        return mouth_region(landmarks_px, self.interocular_size_px, self.margin, lips_px=lips)

    def likelihood(
        self,
        linear_rgb: np.ndarray,
        landmarks_px: np.ndarray,
        lips_px: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Likelihood maps (inner, outer), both (h, w) float32 in [0, 1], zero far from the mouth.

        Args:
            linear_rgb: (h, w, 3) float32.
            landmarks_px: (66, 2) of the face in it.
            lips_px: rings (n, 2), outer and inner, of the tracked lips (`features.tracked_lips`).
        """
        region = self.region(landmarks_px, lips_px)
        maps = self.region_likelihood(region.crop(linear_rgb), region)
        inner, outer = (region.paste(maps[name], linear_rgb.shape[:2]) for name in CONTOURS)
        return inner, outer

    @abstractmethod
    def region_likelihood(self, image: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Name of the contour -> (size, size) likelihood of a cropped region."""


@dataclass(frozen=True)
class BoostedDetector(ContourDetector):
    """Boosted edge learning (Dollar et al. 2006; Lips16 3.2.2): a forest a contour.

    Attributes:
        forests: name of the contour -> its trees.
        interocular_size_px: inter-ocular distance of the region that the trees see.
        margin: of the region round the mouth, per inter-ocular distance.
        smoothing_px: deviation of the Gaussian on the maps, region pixels.
    """

    kind = "boosted"

    forests: dict[str, Forest]
    interocular_size_px: float
    margin: float
    smoothing_px: float = 1.0

    def region_likelihood(self, image: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Name of the contour -> (size, size) likelihood of a cropped region."""
        integrals = integral_images(image_channels(image))
        rows, columns = np.nonzero(region.mask)
        maps = {}
        for name, forest in self.forests.items():
            values = np.zeros(region.mask.shape, dtype=np.float32)
            log_odds = forest.log_odds(integrals, columns, rows)
            values[rows, columns] = 1.0 / (1.0 + np.exp(-log_odds))
            maps[name] = cv2.GaussianBlur(values, (0, 0), self.smoothing_px) * region.mask
        return maps

    def save(self, path: str | Path) -> None:
        """Write `.npz` of plain arrays, whole or not at all."""
        arrays = {
            "format_version": FORMAT_VERSION,
            "kind": self.kind,
            "channels": np.array(CHANNELS),
            "interocular_size_px": self.interocular_size_px,
            "margin": self.margin,
            "smoothing_px": self.smoothing_px,
        }
        for name, forest in self.forests.items():
            arrays |= {
                f"{name}/channel": forest.pool.channel,
                f"{name}/boxes": forest.pool.boxes,
                f"{name}/weights": forest.pool.weights,
                f"{name}/feature": forest.feature,
                f"{name}/threshold": forest.threshold,
                f"{name}/leaf": forest.leaf,
                f"{name}/prior": forest.prior,
                f"{name}/reject": forest.reject,
            }
        save_arrays(path, arrays)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> BoostedDetector:
        forests = {}
        for name in CONTOURS:
            part = {key[len(name) + 1 :]: arrays[key] for key in arrays if key.startswith(name)}
            pool = FeaturePool(part["channel"], part["boxes"], part["weights"])
            forests[name] = Forest(
                pool,
                part["feature"],
                part["threshold"],
                part["leaf"],
                float(part["prior"]),
                part["reject"],
            )
        return cls(
            forests,
            float(arrays["interocular_size_px"]),
            float(arrays["margin"]),
            float(arrays["smoothing_px"]),
        )


def save_arrays(path: str | Path, arrays: dict) -> None:
    """Write a detector file."""
    write_arrays(path, compressed=True, **arrays)


def load_detector(path: str | Path) -> ContourDetector:
    """Read a detector of any kind. Raises ModelFileError on a damaged or newer file."""
    from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
    from vermilion.contours.track_ridge import TrackRidgeDetector

    detectors = (BoostedDetector, TrackRidgeDetector, LandmarkRidgeDetector)
    kinds = {detector.kind: detector.from_arrays for detector in detectors}
    expected = f"a contour detector of format {FORMAT_VERSION}"
    hint = "Remove the file and run again: the detector is trained anew."
    arrays = read_arrays(path, "contour detector", error=ModelFileError)
    try:
        version, kind = int(arrays["format_version"]), str(arrays["kind"])
        if version != FORMAT_VERSION or kind not in kinds:
            raise ModelFileError(f"format {version}, kind {kind}", expected, hint, path=path)
        if kind == BoostedDetector.kind and tuple(arrays["channels"]) != CHANNELS:
            raise ModelFileError("other image channels", expected, hint, path=path)
        return kinds[kind](arrays)
    except KeyError as error:
        raise ModelFileError(f"a file without {error}", expected, hint, path=path) from error
