"""The feature vector of every frame of a chunk: shape coefficients, then contour distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from vermilion.features.contour_features import FrameContours
from vermilion.features.distances import NAMES
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.quality import QualityRow


@dataclass(frozen=True)
class FeatureTable:
    """Features of some frames of a take (Lips16 5.1).

    Attributes:
        frames: (F,) int.
        features: (F, M) float64: |psi| shape coefficients in mm, 20 distances per inter-ocular
            distance, in the head frame where `names` say `head_`, else in the image.
        names: (M,) str.
        outer_px, inner_px: (F, n, 2) contours in the image.
        outer_found, inner_found: (F, n) bool; elsewhere the model's contour stands in.
        valid: (F,) bool.
        found: (F, 2) share of the outer and of the inner samples that met a maximum.
    """

    frames: np.ndarray
    features: np.ndarray
    names: np.ndarray
    outer_px: np.ndarray
    inner_px: np.ndarray
    outer_found: np.ndarray
    inner_found: np.ndarray
    valid: np.ndarray
    found: np.ndarray

    @classmethod
    def of(
        cls,
        frames: Sequence[int],
        shape: np.ndarray,
        contours: Sequence[FrameContours],
        valid: Sequence[bool],
        space: str = "image",
    ) -> FeatureTable:
        """Join shape coefficients (F, P) and the contours of the same frames.

        `space`: `head` or `image`, where the contours' distances were measured.
        """
        distances = np.stack([entry.distances for entry in contours])
        found = [[entry.outer_found.mean(), entry.inner_found.mean()] for entry in contours]
        rings = ("outer_px", "inner_px", "outer_found", "inner_found")
        return cls(
            frames=np.asarray(frames, dtype=np.int64),
            features=np.concatenate([shape, distances], axis=1),
            names=feature_names(shape.shape[1], space),
            **{name: np.stack([getattr(entry, name) for entry in contours]) for name in rings},
            valid=np.asarray(valid, dtype=bool),
            found=np.asarray(found),
        )

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, compressed=True, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> FeatureTable:
        """Read what `save` wrote. Raises InputError on any other file."""
        return cls(**read_arrays(path, "feature file", [f.name for f in fields(cls)]))


def feature_names(n_shape: int, space: str = "image") -> np.ndarray:
    """Names of the features, (M,) str; distances in the head frame begin with `head_`."""
    prefix = "head_" if space == "head" else ""
    shape = (f"shape_{k + 1:02d}" for k in range(n_shape))
    return np.array([*shape, *(prefix + name for name in NAMES)])


def quality_row(
    frame: int, contours: FrameContours, tracked: bool, has_maps: bool, least_found: float
) -> QualityRow:
    """Quality row of a frame: valid when tracked, and enough of its outer contour found.

    Args:
        frame: its number.
        contours: found in it.
        tracked, has_maps: what the earlier stages say.
        least_found: share of the outer samples.
    """
    outer, inner = contours.outer_found.mean(), contours.inner_found.mean()
    away = np.linalg.norm(contours.outer_px - contours.model_outer_px, axis=1)
    figures = {
        "outer_found_share": float(outer),
        "inner_found_share": float(inner),
        "model_to_outer_px": float(away.mean()),
        "interocular_px": contours.interocular_px,
    }
    if not tracked:
        return QualityRow(frame, False, "not tracked", figures)
    if not has_maps:
        return QualityRow(frame, False, "no contour maps", figures)
    if outer < least_found:
        return QualityRow(frame, False, f"only {outer:.0%} of the outer contour found", figures)
    return QualityRow(frame, figures=figures)
