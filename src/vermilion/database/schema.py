"""What lies where in `lips.h5`; `docs/database.md` tells the same to a reader of the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FORMAT = "vermilion-lip-database"
FORMAT_VERSION = 3

LAYER_NUMBERS = ("rx", "ry", "rz", "sxx-1", "syy-1", "szz-1", "sxy", "sxz", "syz")


@dataclass(frozen=True)
class SubjectEntry:
    """A person.

    Attributes:
        subject: name.
        neutral_mm: (V, 3) coarse neutral of the person in the head frame (`identity.npz`), by which
            a regressor knows them again.
        mask: (M,) ascending ids of the coarse triangles whose layers were made.
        neutral_features: features (M',) of the person's neutral frame (`neutral_pair.npz`); None where
            it has none.
    """

    subject: str
    neutral_mm: np.ndarray
    mask: np.ndarray
    neutral_features: np.ndarray | None = None


@dataclass(frozen=True)
class TakeEntry:
    """The frames of a take.

    Attributes:
        subject: name of the person.
        take: name of the take.
        fps: frames a second.
        split: the take sheet's text.
        frames: (F,) int32 frame numbers, ascending.
        features: (F, M) float32.
        layers: (F, T, 9) float32 over the mask.
        displacement_mm: (F, N, 3) float32 from C to H at the corners of the mask, head frame.
        valid: (F,) bool, both features and layers are good.
        train: (F,) bool, regressors may train on the frame.
    """

    subject: str
    take: str
    fps: float
    split: str
    frames: np.ndarray
    features: np.ndarray
    layers: np.ndarray
    displacement_mm: np.ndarray
    valid: np.ndarray
    train: np.ndarray

    def __post_init__(self) -> None:
        n_frames = len(self.frames)
        for name in ("features", "layers", "displacement_mm", "valid", "train"):
            if len(getattr(self, name)) != n_frames:
                raise ValueError(
                    f"{self.subject}/{self.take}: {name} has {len(getattr(self, name))} frames, "
                    f"expected {n_frames}"
                )
