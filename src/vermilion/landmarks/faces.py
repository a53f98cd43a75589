"""All faces that a detector sees in some frames of a take, and what these frames look like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.landmarks.cuts import FrameLooks, frame_look, no_look
from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.gradients import grey_of
from vermilion.landmarks.scheme import JAW, N_LANDMARKS, face_size_px, interocular_px
from vermilion.landmarks.sets import IBUG66, LandmarkSet, set_of
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress

#: Landmarks of brows, eyes, nose and mouth.
INNER_FACE = np.arange(len(JAW), N_LANDMARKS)
#: Deviation of the blur of an image that shows what its pixels can.
_SHARP_PX = 1.0


@dataclass(frozen=True)
class SeenFaces:
    """M faces in F frames.

    Attributes:
        frames: (F,) int frame numbers.
        looks: of the frames.
        reasons: (F,) str, why a frame could not be looked at; empty where it was.
        frame: (M,) int, the frame number of each face.
        centre_px: (M, 2) middle of its landmarks' box.
        size_px: (M,) root of its box's area.
        eyes_px: (M,) distance of its outer eye corners.
        sharp_eyes_px: (M,) the same in an image just sharp enough: less where the face is blurred.
        sureness: (M,) mean confidence in [0, 1].
        shape: (M, 66, 3) its landmarks with depth, about their mean, by the size; depth zero where the
            detector tells none.
        image_size_px: (2,) width and height of the images; zero where none was read.
    """

    frames: np.ndarray
    looks: FrameLooks
    reasons: np.ndarray
    frame: np.ndarray
    centre_px: np.ndarray
    size_px: np.ndarray
    eyes_px: np.ndarray
    sharp_eyes_px: np.ndarray
    sureness: np.ndarray
    shape: np.ndarray
    image_size_px: np.ndarray

    @classmethod
    def load(cls, paths: Sequence[str | Path]) -> SeenFaces:
        """Read what `FaceFinds.save` wrote, of all chunks of a take; landmarks are left alone."""
        names = ("thumbnails", "colours", *_PER_TAKE, *_PER_FACE)
        parts = []
        for path in paths:
            arrays = read_arrays(path, "file of faces", names)
            looks = FrameLooks(arrays["thumbnails"], arrays["colours"])
            parts.append(cls(looks=looks, **{n: arrays[n] for n in (*_PER_TAKE, *_PER_FACE)}))
        return cls.joined(parts)

    @classmethod
    def joined(cls, parts: Sequence[SeenFaces]) -> SeenFaces:
        """The faces of frames that no two of the parts share, in order of frame."""
        frames = np.concatenate([part.frames for part in parts])
        order = np.argsort(frames, kind="stable")
        frame = np.concatenate([part.frame for part in parts])
        face_order = np.argsort(frame, kind="stable")
        faces = {
            n: np.concatenate([getattr(p, n) for p in parts])[face_order]
            for n in _PER_FACE
        }  # fmt: skip
        thumbnails = np.concatenate([part.looks.thumbnails for part in parts])[order]
        colours = np.concatenate([part.looks.colours for part in parts])[order]
        return cls(
            frames=frames[order],
            looks=FrameLooks(thumbnails, colours),
            reasons=np.concatenate([part.reasons for part in parts])[order],
            image_size_px=np.max([part.image_size_px for part in parts], axis=0),
            **faces,
        )

    def of_frames(self, frames: Sequence[int]) -> SeenFaces:
        """The faces of some of the frames."""
        rows, faces = np.isin(self.frames, frames), np.isin(self.frame, frames)
        return replace(
            self,
            frames=self.frames[rows],
            looks=FrameLooks(self.looks.thumbnails[rows], self.looks.colours[rows]),
            reasons=self.reasons[rows],
            **{name: getattr(self, name)[faces] for name in _PER_FACE},
        )


@dataclass(frozen=True)
class FaceFinds:
    """The faces of a chunk's frames with their landmarks.

    Attributes:
        frames: (F,) int frame numbers.
        faces: F lists of faces, the most prominent first.
        looks: of the frames.
        reasons: F texts, why a frame could not be looked at; empty where it was.
        sharp_eyes_px: F lists, of each face the distance of its eyes in an image just sharp enough.
        landmark_set: what the landmarks are.
        image_size_px: (width, height) of the images.
    """

    frames: np.ndarray
    faces: list[list[Landmarks]]
    looks: FrameLooks
    reasons: list[str]
    sharp_eyes_px: list[list[float]]
    landmark_set: LandmarkSet
    image_size_px: tuple[int, int]

    def seen(self) -> SeenFaces:
        """The same faces without their landmarks."""
        flat, ids = [face for faces in self.faces for face in faces], self.landmark_set.ibug66
        points = np.array([f.as_ibug66().points_px for f in flat]).reshape(-1, N_LANDMARKS, 2)
        deep = [np.zeros(N_LANDMARKS) if f.depth_px is None else f.depth_px[ids] for f in flat]
        low, high, size = points.min(axis=1), points.max(axis=1), face_size_px(points)
        depths = np.array(deep).reshape(-1, N_LANDMARKS, 1)
        shape = np.concatenate([points, depths], axis=-1)
        shape = (shape - shape.mean(axis=1, keepdims=True)) / size[:, None, None]
        sure = [face.confidence.mean() for face in flat]
        return SeenFaces(
            frames=self.frames,
            looks=self.looks,
            reasons=np.array(self.reasons, dtype=str),
            frame=np.repeat(self.frames, [len(faces) for faces in self.faces]),
            centre_px=0.5 * (low + high),
            size_px=size,
            eyes_px=interocular_px(points),
            sharp_eyes_px=np.array([px for row in self.sharp_eyes_px for px in row], dtype=float),
            sureness=np.array(sure, dtype=float),
            shape=shape.astype(np.float32),
            image_size_px=np.array(self.image_size_px),
        )

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        flat, n_points = (
            [face for faces in self.faces for face in faces],
            self.landmark_set.n_points,
        )
        arrays: dict[str, Any] = {}
        if any(f.depth_px is not None for f in flat):
            depth = [np.zeros(n_points) if f.depth_px is None else f.depth_px for f in flat]
            arrays["depth_px"] = np.array(depth).reshape(-1, n_points)
        seen = self.seen()
        write_arrays(
            path,
            thumbnails=seen.looks.thumbnails,
            colours=seen.looks.colours,
            points_px=np.array([f.points_px for f in flat]).reshape(-1, n_points, 2),
            confidence=np.array([f.confidence for f in flat]).reshape(-1, n_points),
            landmark_set=np.array(self.landmark_set.name),
            **{name: getattr(seen, name) for name in (*_PER_TAKE, *_PER_FACE)},
            **arrays,
        )

    @classmethod
    def load(cls, path: str | Path) -> FaceFinds:
        """Read what `save` wrote."""
        arrays = read_arrays(path, "file of faces")
        frames, kind = arrays["frames"], set_of(str(arrays["landmark_set"]))
        faces: list[list[Landmarks]] = []
        sharp = []
        for frame in frames:
            rows = np.flatnonzero(arrays["frame"] == frame)
            sharp.append(arrays["sharp_eyes_px"][rows].tolist())
            faces.append(
                [
                    Landmarks(
                        arrays["points_px"][row],
                        arrays["confidence"][row],
                        True,
                        kind,
                        arrays["depth_px"][row] if "depth_px" in arrays else None,
                    )
                    for row in rows
                ]
            )
        looks = FrameLooks(arrays["thumbnails"], arrays["colours"])
        width, height = (int(n) for n in arrays["image_size_px"])
        reasons = arrays["reasons"].tolist()
        return cls(frames, faces, looks, reasons, sharp, kind, (width, height))


_PER_TAKE = ("frames", "reasons", "image_size_px")
_PER_FACE = ("frame", "centre_px", "size_px", "eyes_px", "sharp_eyes_px", "sureness", "shape")


def find_faces(
    read: Callable[[int], np.ndarray],
    find: Callable[[int, np.ndarray | None], list[Landmarks]],
    frames: Sequence[int],
    landmark_set: LandmarkSet = IBUG66,
) -> FaceFinds:
    """The faces of some frames.

    Args:
        read: image (h, w, 3), linear RGB, of a frame; may raise InputError.
        find: faces in a frame of a number, given its image (h, w, 3), or None where it could not be
            read; may raise InputError.
        frames: frame numbers.
        landmark_set: the set that `find` gives.
    """
    faces, looks, reasons, sharp, size = [], [], [], [], (0, 0)
    for frame in progress(frames, "landmarks"):
        image, reason, found, look = None, "", [], no_look()
        try:
            image = read(frame)
            look, size = frame_look(image), (image.shape[1], image.shape[0])
        except InputError as error:
            reason = str(error)
        try:
            found = find(frame, image)
        except InputError as error:
            reason = reason or str(error)
        faces.append(found)
        sharp.append([sharp_eyes_px(image, face) for face in found])
        looks.append(look)
        reasons.append(reason)
    numbers = np.asarray(frames, dtype=np.int64)
    return FaceFinds(numbers, faces, FrameLooks.of(looks), reasons, sharp, landmark_set, size)


def sharp_eyes_px(image: np.ndarray | None, face: Landmarks) -> float:
    """Distance of a face's outer eye corners, px, in an image that is just sharp enough to show it.

    The steepest edges of eyes and mouth, over the contrast there, tell how wide the image's blur is. Pixels
    finer than that count for nothing.

    Args:
        image: (h, w, 3) linear RGB; None: taken for sharp.
        face: in the image.
    """
    points = face.as_ibug66().points_px
    eyes = float(interocular_px(points))
    if image is None:
        return eyes
    inner = points[INNER_FACE]
    low = np.clip(np.floor(inner.min(axis=0)).astype(int) - 2, 0, None)
    high = np.ceil(inner.max(axis=0)).astype(int) + 3
    crop = image[low[1] : high[1], low[0] : high[0]]
    if min(crop.shape[:2]) < 8:
        return eyes
    grey = grey_of(np.ascontiguousarray(crop))
    steep = np.hypot(*np.gradient(grey))
    contrast = float(np.ptp(np.percentile(grey, [2, 98])))
    blur_px = contrast / (np.sqrt(2 * np.pi) * max(float(np.percentile(steep, 99.5)), 1e-6))
    return eyes / max(1.0, blur_px / _SHARP_PX)
