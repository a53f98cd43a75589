"""Boosted edge learning: the detector that was trained on labelled frames (Lips16 3.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import cv2
import numpy as np

from vermilion.contours.boosting import Forest
from vermilion.contours.channels import CHANNELS, image_channels, integral_images
from vermilion.contours.detector import ContourDetector
from vermilion.contours.labels import CONTOURS
from vermilion.contours.pool import FeaturePool
from vermilion.contours.region import MouthRegion

#: What of a forest is in the file.
_POOL, _TREES = (
    ("channel", "boxes", "weights"), ("feature", "threshold", "leaf", "prior", "reject"),
)  # fmt: skip


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
        """Contour -> likelihood (size, size) of a cropped `image` (size, size, 3), linear RGB."""
        integrals = integral_images(image_channels(image))
        rows, columns = np.nonzero(region.mask)
        maps = {}
        for name, forest in self.forests.items():
            values = np.zeros(region.mask.shape, dtype=np.float32)
            log_odds = forest.log_odds(integrals, columns, rows)
            values[rows, columns] = 1.0 / (1.0 + np.exp(-log_odds))
            maps[name] = cv2.GaussianBlur(values, (0, 0), self.smoothing_px) * region.mask
        return maps

    def arrays(self) -> dict[str, np.ndarray | float]:
        """All that the detector is, by name: numbers, and arrays (N, ...) of N features or T trees."""
        arrays: dict[str, np.ndarray | float] = {
            "channels": np.array(CHANNELS),
            "interocular_size_px": self.interocular_size_px,
            "margin": self.margin,
            "smoothing_px": self.smoothing_px,
        }
        for name, forest in self.forests.items():
            of_pool = {part: getattr(forest.pool, part) for part in _POOL}
            of_trees = {part: getattr(forest, part) for part in _TREES}
            arrays |= {f"{name}/{part}": values for part, values in (of_pool | of_trees).items()}
        return arrays

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> Self:
        """Of what `arrays` gave, each (N, ...) or (). Raises KeyError where something is missing."""
        forests = {}
        for name in CONTOURS:
            pool = FeaturePool(*(arrays[f"{name}/{part}"] for part in _POOL))
            trees: dict[str, Any] = {part: arrays[f"{name}/{part}"] for part in _TREES}
            forests[name] = Forest(pool, **trees | {"prior": float(trees["prior"])})
        sizes = ("interocular_size_px", "margin", "smoothing_px")
        return cls(forests, *(float(arrays[size]) for size in sizes))
