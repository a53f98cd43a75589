"""A coarse track of the take, clip by clip, from anchor frame to anchor frame (Beeler et al. 2011).

Each clip between two anchors is tracked from frame to frame, forward from its first anchor and
backward from the one that ends it, and the two are blended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.imaging.sampling import sample_bilinear
from vermilion.multiview.anchors import Anchor, LoadFrame, TrackSettings
from vermilion.multiview.motion import (
    Measurements,
    ReferenceFrame,
    SolveSettings,
    see_all,
    solve_motion,
)
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.views import Frame
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class Clip:
    """Coarse positions of the frames from an anchor to the frame before the next.

    Attributes:
        frames: (F,) frame numbers; none where the clip has no anchor of its own.
        coarse_mm: (F, V, 3).
        reasons: (F,) empty, or why the frame could not be tracked (its position is that of a
            neighbour).
    """

    frames: np.ndarray
    coarse_mm: np.ndarray
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Track:
    """Coarse positions of a take.

    Attributes:
        frames: (F,) frame numbers.
        coarse_mm: (F, V, 3) float32.
        similarity: (F,) correlation of the images with the neutral's; NaN where no anchor was
            sought or the frame is unreadable.
        anchors: (F,) bool.
        reasons: (F,) empty, or why the frame could not be tracked.
    """

    frames: np.ndarray
    coarse_mm: np.ndarray
    similarity: np.ndarray
    anchors: np.ndarray
    reasons: tuple[str, ...]


def join_clips(clips: Sequence[Clip], anchors: Sequence[Anchor]) -> Track:
    """The track of a take from all its clips, in order, and its anchors after the neutral."""
    frames = np.concatenate([clip.frames for clip in clips]).astype(np.int64)
    if not np.array_equal(frames, np.arange(frames[0], frames[0] + len(frames))):
        raise ValueError("the clips do not follow one another")
    similarity = np.full(len(frames), np.nan)
    for anchor in anchors:
        similarity[anchor.window - frames[0]] = anchor.similarity
    similarity[0] = 1.0
    marked = np.isin(frames, [frames[0], *(anchor.frame for anchor in anchors)])
    coarse = np.concatenate([clip.coarse_mm for clip in clips if len(clip.frames)])
    reasons = sum((clip.reasons for clip in clips), ())
    return Track(frames, coarse.astype(np.float32), similarity, marked, reasons)


def track_clip(
    reference: ReferenceFrame,
    frames: Sequence[int],
    load: LoadFrame,
    first_mm: np.ndarray,
    last_mm: np.ndarray | None,
    matcher: FlowMatcher,
    settings: TrackSettings,
) -> Clip:
    """Track a clip whose first frame is known.

    Args:
        reference: the neutral.
        frames: of the clip, and the anchor that ends it where `last_mm` is its position.
        load: reads a frame at the reference's resolution; raises InputError if it cannot.
        first_mm, last_mm: (V, 3) of the first frame and of the anchor, world, mm; None: no anchor.
        matcher: of images.
        settings: see `TrackSettings`.
    """
    forward, reasons = _sweep(reference, frames, load, first_mm, matcher, settings)
    if last_mm is None:
        return Clip(np.array(frames), forward, reasons)
    backward, _ = _sweep(reference, frames[::-1], load, last_mm, matcher, settings)
    share = np.linspace(0, 1, len(frames))[:, None, None]
    blended = (1 - share) * forward + share * backward[::-1]
    return Clip(np.array(frames[:-1]), blended[:-1], reasons[:-1])


def _sweep(reference, frames, load, start_mm, matcher, settings):
    """Frame to frame from a known first: (positions (F, V, 3), reasons (F,)).

    An unreadable frame keeps the position before it.
    """
    positions, reasons = [np.asarray(start_mm, dtype=np.float64)], [""]
    before = load(frames[0])
    for number in frames[1:]:
        try:
            after = load(number)
        except InputError as error:
            positions.append(positions[-1])
            reasons.append(str(error))
            continue
        positions.append(follow(reference, before, after, positions[-1], matcher, settings))
        reasons.append("")
        before = after
    return np.array(positions), tuple(reasons)


def follow(
    reference: ReferenceFrame,
    before: Frame,
    after: Frame,
    vertices_mm: np.ndarray,
    matcher: FlowMatcher,
    settings: TrackSettings,
) -> np.ndarray:
    """Carry a mesh from one frame to the next by the flow between their images.

    Flow that does not lead back to where it began, and flow between unlike places, weighs less.

    Args:
        reference: the neutral.
        before, after: the two frames.
        vertices_mm: (V, 3) of the frame before, world, mm.
        matcher: of images.
        settings: see `TrackSettings`.

    Returns:
        (V, 3) of the frame after, world, mm.
    """
    sights = see_all(before, vertices_mm, reference.triangles)
    jacobians, offsets, weights = [], [], []
    for name, view in before.views.items():
        if name not in after.views:
            continue
        there, seen = after.views[name], sights[name]
        flow = matcher.flow(view.normalised, there.normalised)
        whole = np.ones(flow.shape[:2], dtype=bool)
        agreement = matcher.agreement(view.normalised, there.normalised, flow, whole)
        missed = matcher.round_trip(flow, matcher.flow(there.normalised, view.normalised))
        at = sample_bilinear(np.dstack([flow, agreement, missed]), seen.pixels)
        weight = np.clip((at[:, 2] - settings.min_agreement) / (1 - settings.min_agreement), 0, 1)
        weight = weight / (1 + (at[:, 3] / (2 * settings.sigma_px)) ** 2)
        weights.append(np.where(seen.visible, weight * np.clip(seen.cosine, 0, 1), 0.0))
        offsets.append(at[:, :2].astype(np.float64))
        jacobians.append(view.camera.pixel_jacobian(vertices_mm))
    if not jacobians:  # no camera has both frames
        return vertices_mm
    measured = Measurements(np.array(jacobians), np.array(offsets), np.array(weights))
    solve = SolveSettings(
        settings.length_mm,
        reference.px_per_mm,
        settings.sigma_px,
        settings.max_step_mm,
        keep_shape=False,  # or the pull of every step would add up
        rounds=2,
        tolerance=1e-3,
    )
    return vertices_mm + solve_motion(reference.plate, vertices_mm, measured, solve).step_mm
