"""Key frames: frames whose landmarks are trusted, between which flow corrects (Mono13 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from vermilion.landmarks.binary_patterns import PatternSettings, ReferenceShape, describe
from vermilion.landmarks.descent import ImageSimilarity
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import N_LANDMARKS
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.frames import readable
from vermilion.storage.progress import progress

#: Where a key frame comes from: a person or another tracker; like the neutral; divides a clip.
GIVEN, NEUTRAL, BETWEEN = "given", "neutral", "between"


@dataclass(frozen=True)
class KeyFrameSettings:
    """How many key frames there are.

    Attributes:
        share: of the take's frames that are initial key frames.
        max_clip: frames between key frames, beyond which a clip is divided.
    """

    share: float = 0.025
    max_clip: int = 50


@dataclass(frozen=True)
class KeyFrames:
    """The key frames of a take.

    Attributes:
        frames: (K,) int frame numbers, ascending.
        points_px: (K, 66, 2) landmarks that count there.
        kinds: (K,) str, each `given`, `neutral` or `between`.
        take_frames: (F,) all frames of the take.
        region_distance, patch_distance: (F,) chi-squared distances to the reference frame by eyes
            and mouth and by patches round the landmarks; infinite where there is no face.
    """

    frames: np.ndarray
    points_px: np.ndarray
    kinds: np.ndarray
    take_frames: np.ndarray
    region_distance: np.ndarray
    patch_distance: np.ndarray

    @property
    def given(self) -> dict[int, np.ndarray]:
        """Points (66, 2) of the given key frames by frame number."""
        rows = np.flatnonzero(self.kinds == GIVEN)
        return {int(self.frames[row]): self.points_px[row] for row in rows}

    def table(self) -> list[dict]:
        """A row a frame of the take: its distances and, for key frames, what kind they are."""
        kinds = dict(zip(self.frames.tolist(), self.kinds.tolist(), strict=True))
        distances = zip(
            self.take_frames.tolist(), self.region_distance, self.patch_distance, strict=True
        )
        return [
            {
                "frame": frame,
                "key_frame": kinds.get(frame, ""),
                "region_distance": region if np.isfinite(region) else np.nan,
                "patch_distance": patch if np.isfinite(patch) else np.nan,
            }
            for frame, region, patch in distances
        ]

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> KeyFrames:
        """Read what `save` wrote."""
        return cls(**read_arrays(path, "file of key frames", cls.__dataclass_fields__))


def find_key_frames(
    read_grey: Callable[[int], np.ndarray],
    track: LandmarkTrack,
    given: Mapping[int, np.ndarray],
    settings: KeyFrameSettings | None = None,
) -> KeyFrames:
    """Compare all frames of a take with the first that has a face, and choose the key frames.

    Args:
        read_grey: display brightness (h, w) in [0, 1] of a frame; may raise InputError.
        track: detected landmarks of the whole take, without the offset from the given ones.
        given: trusted landmarks (66, 2) by frame number.
    """
    patterns = PatternSettings()
    points = track.points_px.copy()
    for row, frame in enumerate(track.frames):
        points[row] = given.get(int(frame), points[row])
    has_points = np.isfinite(points).all(axis=(1, 2))
    region, patch = np.full((2, len(points)), np.inf)
    reference = first = None
    rows_with_face = progress(np.flatnonzero(has_points).tolist(), "likeness")
    for row, grey in readable(rows_with_face, lambda row: read_grey(int(track.frames[row]))):
        if reference is None:
            reference = ReferenceShape.of(points[row], patterns)
        look = describe(grey, points[row], reference, patterns)
        first = first or look
        region[row], patch[row] = first.region_distance(look), first.patch_distance(look)
    is_given = np.isin(track.frames, list(given)) & np.isfinite(region)
    chosen: dict[int, str] = {}
    for number in np.unique(track.pieces):  # every piece between cuts has key frames of its own
        own = np.flatnonzero(track.pieces == number)
        found = choose_key_frames(
            region[own], patch[own], is_given[own], settings or KeyFrameSettings()
        )
        chosen |= {int(own[row]): kind for row, kind in found.items()}
    rows = np.array(sorted(chosen), dtype=int)
    return KeyFrames(
        track.frames[rows],
        points[rows].reshape(-1, N_LANDMARKS, 2),
        np.array([chosen[row] for row in rows], dtype=str),
        track.frames,
        region,
        patch,
    )


def choose_key_frames(
    region_distance: np.ndarray,
    patch_distance: np.ndarray,
    is_given: np.ndarray,
    settings: KeyFrameSettings,
) -> dict[int, str]:
    """Rows of the key frames and what they are.

    The frames that look most like the reference, then, as long as a clip is too long, the one in
    its middle half whose patches do: so a division always shortens the clip.

    Args:
        region_distance, patch_distance: (F,), infinite where a frame cannot be a key frame.
        is_given: (F,) bool, frames with trusted landmarks.
    """
    count = max(round(settings.share * len(region_distance)), 1)
    order = np.argsort(region_distance, kind="stable")[:count]
    kinds = {int(row): NEUTRAL for row in order if np.isfinite(region_distance[row])}
    kinds.update({int(row): GIVEN for row in np.flatnonzero(is_given)})
    ends = sorted({0, len(region_distance) - 1, *kinds})
    clips = list(pairwise(ends))
    while clips:
        first, last = clips.pop()
        quarter = (last - first) // 4
        middle = np.arange(first + max(quarter, 1), last - max(quarter, 1) + 1)
        middle = middle[np.isfinite(patch_distance[middle])]
        if last - first <= settings.max_clip or not len(middle):
            continue
        row = int(middle[np.argmin(patch_distance[middle])])
        kinds[row] = BETWEEN
        clips += [(first, row), (row, last)]
    return kinds


def without_offset(track: LandmarkTrack, given: Mapping[int, np.ndarray]) -> LandmarkTrack:
    """Take out of detected landmarks how far they lie, on average, from given ones.

    A detector and a person mark different places. The offset is taken in the face's own frame,
    which moves, turns and grows with the landmarks.

    Args:
        track: detected landmarks.
        given: trusted landmarks (66, 2) by frame number; without any, nothing changes.
    """
    rows = [r for r, f in enumerate(track.frames) if int(f) in given and track.valid[r]]
    if not rows:
        return track
    reference = track.points_px[rows[0]]
    offsets = []
    for row in rows:
        off = given[int(track.frames[row])] - track.points_px[row]
        offsets.append(off @ ImageSimilarity.between(track.points_px[row], reference).matrix.T)
    offset, points = np.mean(offsets, axis=0), track.points_px.copy()
    for row in np.flatnonzero(track.valid).tolist():
        points[row] += offset @ ImageSimilarity.between(reference, points[row]).matrix.T
    return replace(track, points_px=points)
