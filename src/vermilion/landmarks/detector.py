"""What every landmark detector gives, and how a take's landmarks are kept in a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vermilion.landmarks.sets import IBUG66, LandmarkSet, set_of
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class Landmarks:
    """The landmarks of one face in one image.

    Attributes:
        points_px: (N, 2) float64; the centre of the top-left pixel is (0.5, 0.5).
        confidence: (N,) float64 in [0, 1].
        found: whether a face was found; if not, the points are NaN and the confidence zero.
        landmark_set: what the N points are.
        depth_px: (N,) away from the camera, for detectors that tell it; else None.
    """

    points_px: np.ndarray
    confidence: np.ndarray
    found: bool
    landmark_set: LandmarkSet = IBUG66
    depth_px: np.ndarray | None = None

    @classmethod
    def none(cls, landmark_set: LandmarkSet = IBUG66) -> Landmarks:
        """No face."""
        n_points = landmark_set.n_points
        return cls(np.full((n_points, 2), np.nan), np.zeros(n_points), False, landmark_set)

    def as_ibug66(self) -> Landmarks:
        """The 66 points of `ibug66` alone."""
        ids = self.landmark_set.ibug66
        return Landmarks(self.points_px[ids], self.confidence[ids], self.found)


#: Faces that are looked for in an image.
MAX_FACES = 4
#: Two faces that overlap by more (intersection over the smaller) are one.
SAME_FACE = 0.5


def most_prominent(faces: Sequence[Landmarks], landmark_set: LandmarkSet) -> Landmarks:
    """The first of some faces; none of a set where there is none."""
    return faces[0] if len(faces) else Landmarks.none(landmark_set)


def apart(faces: Sequence[Landmarks], count: int) -> list[Landmarks]:
    """At most `count` of some faces, in their order, without those that another before them covers."""
    kept: list[Landmarks] = []
    for face in faces:
        if len(kept) < count and not any(overlap(face, other) > SAME_FACE for other in kept):
            kept.append(face)
    return kept


def overlap(a: Landmarks, b: Landmarks) -> float:
    """Intersection of two faces' boxes over the smaller of them."""
    low = np.maximum(a.points_px.min(axis=0), b.points_px.min(axis=0))
    high = np.minimum(a.points_px.max(axis=0), b.points_px.max(axis=0))
    least = min(np.prod(np.ptp(face.points_px, axis=0)) for face in (a, b))
    return float(np.prod(np.maximum(high - low, 0.0)) / max(least, 1e-9))


class LandmarkDetector(Protocol):
    """Finds the landmarks of faces, each image by itself.

    Attributes:
        landmark_set: the set that it gives.
    """

    landmark_set: LandmarkSet

    def faces(self, linear_rgb: np.ndarray) -> list[Landmarks]:
        """Up to `MAX_FACES` faces of an image `linear_rgb` (h, w, 3) float32, most prominent first."""

    def detect(self, linear_rgb: np.ndarray) -> Landmarks:
        """Landmarks of the most prominent face of an image `linear_rgb` (h, w, 3) float32."""


@dataclass(frozen=True)
class LandmarkTrack:
    """Landmarks of the frames of a take, or of some of them.

    Attributes:
        frames: (F,) int frame numbers.
        points_px: (F, N, 2); NaN where a frame is not valid.
        confidence: (F, N) in [0, 1].
        valid: (F,) bool.
        landmark_set: what the N points are.
        depth_px: (F, N) away from the camera, NaN where not valid; None where the detector has none.
        piece: (F,) int piece between cuts of each frame, counted from 0; None: all in one.
    """

    frames: np.ndarray
    points_px: np.ndarray
    confidence: np.ndarray
    valid: np.ndarray
    landmark_set: LandmarkSet = IBUG66
    depth_px: np.ndarray | None = None
    piece: np.ndarray | None = None

    @classmethod
    def of(
        cls,
        frames: Sequence[int],
        found: Sequence[Landmarks],
        piece: np.ndarray | None = None,
        landmark_set: LandmarkSet = IBUG66,
    ) -> LandmarkTrack:
        """One entry a frame, all of one set: `landmark_set` where there is none; `piece` (F,) as above."""
        kind = found[0].landmark_set if len(found) else landmark_set
        depth = None
        if any(entry.depth_px is not None for entry in found):
            unknown = np.full(kind.n_points, np.nan)
            depth = np.stack([unknown if e.depth_px is None else e.depth_px for e in found])
        return cls(
            np.asarray(frames, dtype=np.int64),
            np.array([entry.points_px for entry in found]).reshape(-1, kind.n_points, 2),
            np.array([entry.confidence for entry in found]).reshape(-1, kind.n_points),
            np.array([entry.found for entry in found], dtype=bool),
            kind,
            depth,
            piece,
        )

    @property
    def pieces(self) -> np.ndarray:
        """(F,) int piece between cuts of each frame: what follows time stops where it changes."""
        none = np.zeros(len(self.frames), dtype=np.int64)
        return none if self.piece is None else np.asarray(self.piece)

    def as_ibug66(self) -> LandmarkTrack:
        """The 66 points of `ibug66` alone."""
        if self.landmark_set is IBUG66:
            return self
        ids = self.landmark_set.ibug66
        return LandmarkTrack(
            self.frames,
            self.points_px[:, ids],
            self.confidence[:, ids],
            self.valid,
            piece=self.piece,
        )

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        if self.landmark_set is not IBUG66:
            arrays["landmark_set"] = np.array(self.landmark_set.name)
        if self.depth_px is not None:
            arrays["depth_px"] = self.depth_px.astype(np.float32)
        if self.piece is not None:
            arrays["piece"] = self.piece
        write_arrays(path, **arrays)

    @classmethod
    def load(
        cls,
        paths: str | Path | Sequence[str | Path],
        landmark_set: LandmarkSet | None = IBUG66,
    ) -> LandmarkTrack:
        """Read one file, or join several in order of frame.

        Args:
            landmark_set: the set that is wanted; None: the one that the files have.

        Raises:
            InputError: a file cannot be read, or has not the points of the wanted set.
        """
        paths = [paths] if isinstance(paths, str | Path) else list(paths)
        parts = [_read_track(path) for path in paths]
        wanted = landmark_set or parts[0].landmark_set
        parts = [_of_set(part, wanted, path) for part, path in zip(parts, paths, strict=True)]
        order = np.argsort(np.concatenate([part.frames for part in parts]), kind="stable")
        joined = {n: np.concatenate([getattr(p, n) for p in parts])[order] for n in _ARRAYS}
        depth = [part.depth_px for part in parts if part.depth_px is not None]
        piece = np.concatenate([part.pieces for part in parts])[order]
        return cls(
            **joined,
            landmark_set=parts[0].landmark_set,
            depth_px=np.concatenate(depth)[order] if len(depth) == len(parts) else None,
            piece=piece if any(part.piece is not None for part in parts) else None,
        )


def _of_set(track: LandmarkTrack, wanted: LandmarkSet, path: str | Path) -> LandmarkTrack:
    if track.landmark_set is wanted:
        return track
    if wanted is IBUG66:
        return track.as_ibug66()
    raise InputError(
        f"landmarks of the set {track.landmark_set.name}",
        f"those of the set {wanted.name}, as elsewhere in this take or subject",
        "Remove the folder of landmarks of the subject's takes and run again.",
        path=path,
    )


_ARRAYS = ("frames", "points_px", "confidence", "valid")


def _read_track(path: str | Path) -> LandmarkTrack:
    arrays = read_arrays(path, "landmark file")
    if not arrays.keys() >= set(_ARRAYS):
        read_arrays(path, "landmark file", _ARRAYS)  # says what is missing
    name = str(arrays.get("landmark_set", IBUG66.name))
    own = {key: arrays[key] for key in _ARRAYS}
    return LandmarkTrack(
        **own,
        landmark_set=set_of(name),
        depth_px=arrays.get("depth_px"),
        piece=arrays.get("piece"),
    )
