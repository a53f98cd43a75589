"""The coarse track of some frames with all that a correction reads of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.correction.image_contours import IMAGE_ARRAYS, ImageContours
from vermilion.faces.model import FaceModel
from vermilion.storage.chunks import read_chunks, read_frames
from vermilion.storage.sequences import frames_of
from vermilion.tracking.result import TrackedTake

#: Frames that a cut counts for, more than anything over time reaches.
_ROOM = 1_000_000
_PER_FRAME = (
    "frames", "coarse_mm", "rotation", "translation_mm", "features", "valid", "image", "piece",
)  # fmt: skip


@dataclass(frozen=True)
class CoarseTake:
    """The coarse track **C** of some frames of one person.

    Attributes:
        frames: (F,) frame numbers, ascending.
        coarse_mm: (F, V, 3) meshes, world.
        triangles: (T, 3) of the mesh.
        neutral_mm: (V, 3) the subject's coarse neutral, head frame (`identity.npz`). It sets the weights
            of the integration, and a regressor recognises a subject of its training by it.
        rotation: (F, 3, 3), `world_from_head` of the tracker.
        translation_mm: (F, 3), likewise.
        features: (F, M) of the regressor; NaN where a frame has none.
        valid: (F,) bool, frames that were tracked.
        image: contours in the images of the same frames; None where there are none.
        piece: (F,) int piece between cuts of each frame; None: all in one.
    """

    frames: np.ndarray
    coarse_mm: np.ndarray
    triangles: np.ndarray
    neutral_mm: np.ndarray
    rotation: np.ndarray
    translation_mm: np.ndarray
    features: np.ndarray
    valid: np.ndarray
    image: ImageContours | None = None
    piece: np.ndarray | None = None

    @classmethod
    def of(
        cls,
        face: FaceModel,
        fit: TrackedTake,
        neutral_mm: np.ndarray,
        frames: np.ndarray,
        coarse_mm: np.ndarray,
        measured: Mapping[str, np.ndarray],
    ) -> CoarseTake:
        """From the contents of a take's files.

        Args:
            face: the tracker's model.
            fit: poses and camera of the whole take.
            neutral_mm: (V, 3) the subject's coarse neutral, head frame.
            frames: (F,) frame numbers, ascending.
            coarse_mm: (F, V, 3) meshes of these frames, world.
            measured: arrays of the feature files at these frames: `features` (F, M) and IMAGE_ARRAYS.
        """
        rows = fit.index_of(frames)
        return cls(
            frames=np.asarray(frames),
            coarse_mm=np.asarray(coarse_mm, dtype=np.float64),
            triangles=face.triangles,
            neutral_mm=neutral_mm,
            rotation=fit.world_from_head_rotation[rows],
            translation_mm=fit.world_from_head_translation_mm[rows],
            features=np.where(measured["valid"][:, None], measured["features"], np.nan),
            valid=fit.valid[rows],
            image=ImageContours.of(face, fit.camera, measured),
            piece=fit.pieces[rows],
        )

    @classmethod
    def load(
        cls,
        face: FaceModel,
        fit: TrackedTake,
        neutral_mm: np.ndarray,
        coarse: Sequence[str | Path],
        features: Sequence[str | Path],
        frames: Sequence[int],
        reach: int = 0,
    ) -> CoarseTake:
        """Of frames of a take and their neighbours, which their correction depends on.

        Args:
            face, fit: as in `of`; neutral_mm: (V, 3), head frame.
            coarse, features: files of the chunks that hold them.
            frames: frame numbers, ascending.
            reach: neighbours to either side that are read too, where the files have them.
        """
        near = frames_around(frames, frames_of(coarse), reach)
        measured = read_chunks(features, near.tolist(), ["features", *IMAGE_ARRAYS])
        return cls.of(face, fit, neutral_mm, near, read_frames(coarse, near.tolist()), measured)

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def frames_apart(self) -> np.ndarray:
        """(F,) frame numbers with room at every cut, so that nothing over time reaches across."""
        return self.frames if self.piece is None else self.frames + self.piece * _ROOM

    def __getitem__(self, rows: np.ndarray | slice) -> CoarseTake:
        """The same of some frames, by rows or (F,) bool."""
        given: dict[str, Any] = {name: getattr(self, name) for name in _PER_FRAME}
        chosen = {name: v[rows] for name, v in given.items() if v is not None}
        return replace(self, **chosen)

    def usable(self, inputs: np.ndarray) -> np.ndarray:
        """Which frames can be corrected, (F,) bool: tracked, with a finite mesh and finite inputs.

        Args:
            inputs: (F, ...) what the correction is computed from: features or layers.
        """
        finite = np.isfinite(inputs.reshape(len(self), -1)).all(axis=1)
        return self.valid & finite & np.isfinite(self.coarse_mm).all(axis=(1, 2))


def frames_around(frames: Sequence[int], known: np.ndarray, reach: int) -> np.ndarray:
    """Those (F,) of the frame numbers `known` (K,) within `reach` of one of `frames`, ascending."""
    apart = np.abs(np.subtract.outer(np.sort(known), np.asarray(frames)))
    return np.sort(known)[apart.min(axis=1) <= reach]
