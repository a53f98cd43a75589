"""A coarse track of the take: anchor frames, and clips between them (Beeler et al. 2011).

Anchors are frames that look like the neutral; they are registered to it directly, so that drift
cannot build up past them. Each clip between two anchors is tracked from frame to frame, forward
from its first anchor and backward from its last, and the two are blended.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from vermilion.errors import InputError
from vermilion.multiview.motion import Measurements, Reference, see_all, solve_motion
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.refine import register_frame
from vermilion.multiview.views import Frame, pixel_jacobian, sample
from vermilion.raycast import RayCaster

LoadFrame = Callable[[int], Frame]


@dataclass(frozen=True)
class TrackSettings:
    """See `vermilion.config.multiview` for meanings and units."""

    length_mm: float
    sigma_px: float
    min_agreement: float
    max_step_mm: float
    anchor_similarity: float
    anchor_spacing: int


@dataclass(frozen=True)
class Track:
    """Coarse positions of a take.

    Attributes:
        frames: (F,) frame numbers.
        coarse_mm: (F, V, 3) float32.
        similarity: (F,) correlation of each frame's pictures with the neutral's, NaN if unreadable.
        anchors: (F,) bool.
        reasons: (F,) empty, or why the frame could not be tracked (its position is that of the
            frame before).
    """

    frames: np.ndarray
    coarse_mm: np.ndarray
    similarity: np.ndarray
    anchors: np.ndarray
    reasons: tuple[str, ...]


def track_take(
    reference: Reference,
    frames: Sequence[int],
    load: LoadFrame,
    matcher: FlowMatcher,
    settings: TrackSettings,
) -> Track:
    """Track the reference's mesh through a take; the reference is `frames[0]`.

    Args:
        load: reads a frame at the reference's resolution; raises InputError if it cannot.
    """
    frames = list(frames)
    similarity, reasons = _similarities(reference, frames, load)
    anchors = choose_anchors(similarity, settings.anchor_similarity, settings.anchor_spacing)
    coarse = np.zeros((len(frames), *reference.vertices_mm.shape), dtype=np.float32)
    coarse[0] = reference.vertices_mm
    for index in anchors[1:]:
        coarse[index] = _anchor(reference, load(frames[index]), matcher, settings)
    ends = [*anchors, len(frames)]
    for first, last in pairwise(ends):
        numbers = frames[first : last + 1]
        end = coarse[last] if last < len(frames) else None
        clip = track_clip(reference, numbers, load, coarse[first], end, matcher, settings)
        coarse[first : first + len(clip)] = clip
    flags = np.zeros(len(frames), dtype=bool)
    flags[anchors] = True
    return Track(np.array(frames), coarse, similarity, flags, tuple(reasons))


def choose_anchors(similarity: np.ndarray, threshold: float, spacing: int) -> list[int]:
    """Indices of frames most like the first, at least `spacing` apart, in order; with the first.

    Args:
        similarity: (F,) correlation with the first frame; NaN is never chosen.
        threshold: smallest correlation of an anchor.
    """
    chosen = [0]
    for index in np.argsort(-np.nan_to_num(similarity, nan=-1.0), kind="stable"):
        value = similarity[index]
        if not value >= threshold:
            continue
        if min(abs(index - other) for other in chosen) >= spacing:
            chosen.append(int(index))
    return sorted(chosen)


def _similarities(reference: Reference, frames, load) -> tuple[np.ndarray, list[str]]:
    caster = RayCaster(reference.vertices_mm, reference.triangles)
    masks = {name: caster.see(view.camera).hit for name, view in reference.frame.views.items()}
    similarity, reasons = np.full(len(frames), np.nan), [""] * len(frames)
    for index, number in enumerate(frames):
        try:
            frame = load(number)
        except InputError as error:
            reasons[index] = str(error)
            continue
        names = [name for name in frame.views if name in masks]
        values = [
            _correlation(
                reference.frame.views[name].normalised, frame.views[name].normalised, masks[name]
            )
            for name in names
        ]
        similarity[index] = np.mean(values) if values else np.nan
    return similarity, reasons


def _correlation(a: np.ndarray, b: np.ndarray, mask: np.ndarray, sigma_px: float = 2.0) -> float:
    """Correlation of two blurred pictures inside a mask."""
    x, y = (cv2.GaussianBlur(p.astype(np.float32), (0, 0), sigma_px)[mask] for p in (a, b))
    x, y = x - x.mean(), y - y.mean()
    return float((x @ y) / max(np.linalg.norm(x) * np.linalg.norm(y), 1e-9))


def _anchor(reference, frame, matcher, settings) -> np.ndarray:
    levels = [(reference, frame, 2 * settings.length_mm), (reference, frame, settings.length_mm)]
    found = register_frame(
        levels,
        reference.vertices_mm,
        matcher,
        sigma_px=settings.sigma_px,
        max_step_mm=settings.max_step_mm,
        min_agreement=settings.min_agreement,
    )
    return found.vertices_mm


def track_clip(
    reference: Reference,
    frames: Sequence[int],
    load: LoadFrame,
    first_mm: np.ndarray,
    last_mm: np.ndarray | None,
    matcher: FlowMatcher,
    settings: TrackSettings,
) -> np.ndarray:
    """Positions (F, V, 3) of a clip whose first (and last) frame is known."""
    forward = _sweep(reference, frames, load, first_mm, matcher, settings)
    if last_mm is None or len(frames) < 3:
        return forward
    backward = _sweep(reference, frames[::-1], load, last_mm, matcher, settings)[::-1]
    share = np.linspace(0, 1, len(frames))[:, None, None]
    return (1 - share) * forward + share * backward


def _sweep(reference, frames, load, start_mm, matcher, settings) -> np.ndarray:
    """Frame to frame from a known first; an unreadable frame keeps the position before it."""
    positions = [np.asarray(start_mm, dtype=np.float64)]
    before = load(frames[0])
    for number in frames[1:]:
        try:
            after = load(number)
        except InputError:
            positions.append(positions[-1])
            continue
        positions.append(follow(reference, before, after, positions[-1], matcher, settings))
        before = after
    return np.array(positions)


def follow(
    reference: Reference,
    before: Frame,
    after: Frame,
    vertices_mm: np.ndarray,
    matcher: FlowMatcher,
    settings: TrackSettings,
) -> np.ndarray:
    """Carry a mesh from one frame to the next by the flow between their pictures, (V, 3) mm."""
    sights = see_all(before, vertices_mm, reference.triangles)
    jacobians, offsets, weights = [], [], []
    for name, view in before.views.items():
        if name not in after.views:
            continue
        there, seen = after.views[name], sights[name]
        flow = matcher.flow(view.normalised, there.normalised)
        whole = np.ones(flow.shape[:2], dtype=bool)
        agreement = matcher.agreement(view.normalised, there.normalised, flow, whole)
        at = sample(np.dstack([flow, agreement]), seen.pixels)
        weight = np.clip((at[:, 2] - settings.min_agreement) / (1 - settings.min_agreement), 0, 1)
        weights.append(np.where(seen.visible, weight * np.clip(seen.cosine, 0, 1), 0.0))
        offsets.append(at[:, :2].astype(np.float64))
        jacobians.append(pixel_jacobian(view.camera, vertices_mm))
    if not jacobians:  # no camera has both frames
        return vertices_mm
    measured = Measurements(np.array(jacobians), np.array(offsets), np.array(weights))
    solution = solve_motion(
        reference.plate,
        vertices_mm,
        measured,
        settings.length_mm,
        px_per_mm=reference.px_per_mm,
        sigma_px=settings.sigma_px,
        max_step_mm=settings.max_step_mm,
        keep_shape=False,  # or the pull of every step would add up
        rounds=2,
        tolerance=1e-3,
    )
    return vertices_mm + solution.step_mm
