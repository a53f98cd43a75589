"""Anchor frames and the clips between them (Beeler et al. 2011, section 4).

The take is cut at regular borders, so that the jobs are known before an image is read. Near each
border the frame that looks most like the neutral becomes the anchor; it is registered to the neutral
directly, so that drift cannot build up past it. Anchors, and then the clips between them, do not
depend on each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.raycast import RayCaster
from vermilion.multiview.motion import ReferenceFrame
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.refine import FrameMatchSettings, register_frame
from vermilion.multiview.views import Frame
from vermilion.storage.frames import readable

LoadFrame = Callable[[int], Frame]


@dataclass(frozen=True)
class TrackSettings:
    """See `vermilion.config.multiview` for meanings and units."""

    length_mm: float
    sigma_px: float
    min_agreement: float
    max_step_mm: float
    anchor_similarity: float


@dataclass(frozen=True)
class Anchor:
    """The anchor frame near a border, if there is one.

    Attributes:
        frame: its number; -1 where no frame of the window looks enough like the neutral.
        vertices_mm: (V, 3) registered to the neutral; empty without an anchor.
        window: (W,) frames among which it was sought.
        similarity: (W,) correlation of their images with the neutral's, NaN if unreadable.
    """

    frame: int
    vertices_mm: np.ndarray
    window: np.ndarray
    similarity: np.ndarray


def n_clips(first: int, last: int, clip_frames: int) -> int:
    """Clips of a take of frames `first` to `last`, both included; one ends at each border."""
    return max(1, -(-(last - first) // clip_frames))


def anchor_window(first: int, last: int, clip_frames: int, index: int) -> range:
    """Frames among which anchor `index` (1, 2, ...) is sought: a third of a clip to either side."""
    border, reach = first + index * clip_frames, clip_frames // 3
    return range(border - reach, min(border + reach, last) + 1)


def clip_frames_of(
    first: int, last: int, anchor_frames: Sequence[int], index: int
) -> tuple[range, int | None]:
    """Frames of clip `index` and the anchor that ends it.

    Args:
        anchor_frames: of anchors 1, 2, ...; -1 for none.

    Returns:
        (frames, index of the anchor after them); no frames where the clip's own anchor is missing,
        because the clip before goes on through it; None where the take ends before an anchor.
    """
    starts = [first, *anchor_frames]
    if starts[index] < 0:
        return range(0), None
    for following in range(index + 1, len(starts)):
        if starts[following] >= 0:
            return range(starts[index], starts[following]), following
    return range(starts[index], last + 1), None


def find_anchor(
    reference: ReferenceFrame,
    window: Sequence[int],
    load: LoadFrame,
    matcher: FlowMatcher,
    settings: TrackSettings,
) -> Anchor:
    """Choose the anchor of a window by appearance and register it to the reference directly.

    Args:
        load: reads a frame at the reference's resolution; raises InputError if it cannot.
    """
    numbers = np.array(window, dtype=np.int64)
    similarity = similarities(reference, window, load)
    best = choose_anchor(similarity, settings.anchor_similarity)
    if best is None:
        return Anchor(-1, np.zeros((0, 3)), numbers, similarity)
    number = int(numbers[best])
    frame = load(number)
    levels = [(reference, frame, 2 * settings.length_mm), (reference, frame, settings.length_mm)]
    match = FrameMatchSettings(settings.sigma_px, settings.max_step_mm, settings.min_agreement)
    found = register_frame(levels, reference.vertices_mm, matcher, match)
    return Anchor(number, found.vertices_mm, numbers, similarity)


def choose_anchor(similarity: np.ndarray, threshold: float) -> int | None:
    """Index of the greatest similarity (W,), if it reaches the threshold; NaN never does."""
    known = np.nan_to_num(np.asarray(similarity, dtype=float), nan=-1.0)
    if not len(known) or known.max() < threshold:
        return None
    return int(np.argmax(known))


def similarities(reference: ReferenceFrame, frames: Sequence[int], load: LoadFrame) -> np.ndarray:
    """Correlation (F,) of each frame's images with the reference's where the mesh is seen there.

    The mean over the cameras; NaN where the frame cannot be read.
    """
    caster = RayCaster(reference.vertices_mm, reference.triangles)
    views = reference.frame.views
    masks = {name: caster.see(view.camera).hit for name, view in views.items()}
    similarity = np.full(len(frames), np.nan)
    for index, frame in readable(range(len(frames)), lambda index: load(int(frames[index]))):
        values = [
            _correlation(views[name].normalised, view.normalised, masks[name])
            for name, view in frame.views.items()
            if name in masks
        ]
        similarity[index] = np.mean(values) if values else np.nan
    return similarity


def _correlation(a: np.ndarray, b: np.ndarray, mask: np.ndarray, sigma_px: float = 2.0) -> float:
    """Correlation of two blurred images inside a mask."""
    x, y = (cv2.GaussianBlur(p.astype(np.float32), (0, 0), sigma_px)[mask] for p in (a, b))
    x, y = x - x.mean(), y - y.mean()
    return float((x @ y) / max(np.linalg.norm(x) * np.linalg.norm(y), 1e-9))
