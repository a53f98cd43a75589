"""Detected landmarks corrected by flow between key frames (Mono13 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.flow import FaceFlow, carry_along
from vermilion.landmarks.key_frames import KeyFrames, without_offset
from vermilion.landmarks.lip_side import off_lips, onto_lips
from vermilion.landmarks.scheme import (
    EYE_LEFT,
    EYE_RIGHT,
    JAW,
    LIP_INNER_OPEN,
    MOUTH,
    N_LANDMARKS,
    face_size_px,
)
from vermilion.storage.frames import readable
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow

FILLED = "no face found; filled by the flow"


@dataclass(frozen=True)
class LandmarkCorrectionSettings:
    """How detector and flow share.

    Attributes:
        mouth, eyes, jaw, rest: weight of the detected point, lambda of Mono13 eq. 4.
        inner_lips: the same of the inner contour between the corners. It is an outline, which
            flow follows by the lip beside it, see `lip_side`.
        face_px: size of the face where flow is computed, see `FaceFlow`.
        tolerance: share of the face's size that flow may fail to lead back by, summed over the
            frames from the key frame, where its weight is halved.
        fill_confidence: least mean confidence of the flow where it fills a frame without a face.
    """

    mouth: float = 0.1
    inner_lips: float = 0.5
    eyes: float = 0.5
    jaw: float = 0.2
    rest: float = 0.2
    face_px: float = 280.0
    tolerance: float = 0.03
    fill_confidence: float = 0.5

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> LandmarkCorrectionSettings:
        """From the section `landmarks.correction` of the configuration."""
        return cls(**{key: value for key, value in section.items() if key != "mode"})

    def per_landmark(self) -> np.ndarray:
        """Weights (66,) of the detected points."""
        weights = np.full(N_LANDMARKS, self.rest)
        weights[JAW], weights[MOUTH] = self.jaw, self.mouth
        weights[LIP_INNER_OPEN] = self.inner_lips
        weights[np.concatenate([EYE_RIGHT, EYE_LEFT])] = self.eyes
        return weights


@dataclass(frozen=True)
class FlowPoints:
    """Where flow from the key frames puts the landmarks of some frames.

    Attributes:
        points_px: (F, 66, 2), NaN where no flow leads.
        confidence: (F, 66) in [0, 1], zero where no flow leads.
    """

    points_px: np.ndarray
    confidence: np.ndarray


def correct_landmarks(
    read_grey: Callable[[int], np.ndarray],
    detected: LandmarkTrack,
    keys: KeyFrames,
    frames: Sequence[int],
    settings: LandmarkCorrectionSettings | None = None,
) -> tuple[LandmarkTrack, list[QualityRow]]:
    """Corrected landmarks of some frames of a take, and quality rows.

    The result of a frame does not depend on which others are asked for.

    Args:
        read_grey: display brightness (h, w) in [0, 1] of a frame; may raise InputError.
        detected: landmarks of the whole take.
        keys: of the same take.
        frames: frame numbers, ascending.
    """
    settings = settings or LandmarkCorrectionSettings()
    unbiased = without_offset(detected, keys.given)
    rows = np.searchsorted(detected.frames, frames)
    flow = flow_points(read_grey, unbiased, keys, rows, settings)
    at_key = np.isin(detected.frames[rows], list(keys.given))
    track = blend_points(unbiased, rows, flow, at_key, settings)
    return track, quality_rows(detected, rows, track, flow)


def flow_points(
    read_grey: Callable[[int], np.ndarray],
    track: LandmarkTrack,
    keys: KeyFrames,
    rows: np.ndarray,
    settings: LandmarkCorrectionSettings,
) -> FlowPoints:
    """Flow from the key frames before and after, for some rows of a take's track.

    Args:
        read_grey: display brightness (h, w) in [0, 1] of a frame; may raise InputError.
        rows: (F,) of the track.
    """
    points = np.full((len(track.frames), N_LANDMARKS, 2), np.nan)
    confidence = np.zeros(points.shape[:2])
    key_rows = np.searchsorted(track.frames, keys.frames)
    points[key_rows], confidence[key_rows] = keys.points_px, 1.0
    shapes = rough_shapes(track, keys)
    trusted = dict(zip(key_rows.tolist(), keys.points_px, strict=True))
    for first, last in _clips(key_rows, track.pieces):
        inside = np.arange(first, last + 1)
        before, after = trusted.get(first - 1), trusted.get(last + 1)
        # Flow does not lead across a cut.
        before = before if first and track.pieces[first - 1] == track.pieces[first] else None
        after = (
            after if after is not None and track.pieces[last + 1] == track.pieces[last] else None
        )
        if (before is None and after is None) or not np.isin(inside, rows).any():
            continue
        span = np.arange(first - (before is not None), last + 1 + (after is not None))
        found = _clip_points(read_grey, track.frames, span, shapes, (before, after), settings)
        keep = np.isin(span, inside)
        points[span[keep]], confidence[span[keep]] = found[0][keep], found[1][keep]
    return FlowPoints(points[rows], confidence[rows])


def _clips(key_rows: np.ndarray, piece: np.ndarray) -> list[tuple[int, int]]:
    """First and last row of the runs of frames without a key frame or a cut between them.

    Args:
        key_rows: (K,) rows of the key frames.
        piece: (F,) int piece of each frame.
    """
    clips: list[tuple[int, int]] = []
    begin = None
    is_key = np.isin(np.arange(len(piece)), key_rows)
    for row in range(len(piece)):
        if begin is not None and (is_key[row] or piece[row] != piece[row - 1]):
            clips.append((begin, row - 1))
            begin = None
        if begin is None and not is_key[row]:
            begin = row
    return clips if begin is None else [*clips, (begin, len(piece) - 1)]


def _clip_points(read_grey, frames, span, shapes, ends, settings):
    """Points (n, 66, 2) and confidence (n, 66) of the rows `span` between two key frames."""
    read, flows, last = [], [], None
    engine = FaceFlow(settings.face_px)
    for row, grey in readable(progress(span, "flow"), lambda row: read_grey(int(frames[row]))):
        if last is not None:
            flows.append(engine.between(last, grey, shapes[read[-1]], shapes[row]))
        last = grey
        read.append(row)
    points = np.full((len(span), N_LANDMARKS, 2), np.nan)
    confidence = np.zeros(points.shape[:2])
    at = np.isin(span, read)
    paths = []
    if ends[0] is not None:
        paths.append(carry_along(flows, onto_lips(ends[0])))
    if ends[1] is not None:
        back = carry_along([flow.reversed() for flow in flows[::-1]], onto_lips(ends[1]))
        paths.append((back[0][::-1], back[1][::-1]))
    ways = [(off_lips(path), flow_trust(astray, shapes[read], settings)) for path, astray in paths]
    later = (np.asarray(read) - span[0]) / (span[-1] - span[0]) if len(ways) == 2 else None
    points[at], confidence[at] = join_ways(ways, later)
    return points, confidence


def flow_trust(
    astray_px: np.ndarray, shapes: np.ndarray, settings: LandmarkCorrectionSettings
) -> np.ndarray:
    """How sure flow is, (..., 66) in [0, 1], that does not lead back to where it started.

    Args:
        astray_px: (..., 66) by how much it does not.
        shapes: (..., 66, 2) px, about where the face is.
    """
    tolerance = settings.tolerance * face_size_px(shapes)[..., None]
    return 1 / (1 + (astray_px / tolerance) ** 2)


def join_ways(
    ways: Sequence[tuple[np.ndarray, np.ndarray]], later: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 66, 2) and confidence (n, 66) of flow from the key frame before and the one after.

    Args:
        ways: points (n, 66, 2) and trust (n, 66) of each of the one or two flows.
        later: (n,) in [0, 1], how far a frame is from the first key frame to the second.
    """
    if len(ways) == 1 or later is None:
        return ways[0]
    share = (0.5 - 0.5 * np.cos(np.pi * later))[:, None]
    weights = np.stack([(1 - share) * ways[0][1], share * ways[1][1]])
    confidence = weights.sum(axis=0)
    weights = (weights / np.maximum(confidence, 1e-12))[..., None]
    return weights[0] * ways[0][0] + weights[1] * ways[1][0], confidence


def blend_points(
    track: LandmarkTrack,
    rows: np.ndarray,
    flow: FlowPoints,
    at_given: np.ndarray,
    settings: LandmarkCorrectionSettings,
) -> LandmarkTrack:
    """Detected and flow points together (Mono13 eq. 4), for some rows of a track.

    The weight 1 - lambda of the flow is multiplied by its confidence. Where no face was found the
    flow stands alone, if it is sure enough; at given key frames the given points do.

    Args:
        rows: (F,) of the track.
        at_given: (F,) bool, given key frames.
    """
    detected, valid = track.points_px[rows], track.valid[rows]
    weight = settings.per_landmark()
    share = (1 - weight) * flow.confidence / ((1 - weight) * flow.confidence + weight + 1e-12)
    share = np.where((at_given | ~valid)[:, None], 1.0, share)[..., None]
    points = np.where(share > 0, share * np.nan_to_num(flow.points_px), 0.0)
    points = points + np.where(share < 1, (1 - share) * np.nan_to_num(detected), 0.0)
    filled = ~valid & (flow.confidence.mean(axis=1) >= settings.fill_confidence)
    good = valid | filled | at_given
    confidence = np.where(valid[:, None], track.confidence[rows], flow.confidence)
    return LandmarkTrack(
        track.frames[rows],
        np.where(good[:, None, None], points, np.nan),
        np.where(good[:, None], confidence, 0.0),
        good,
        piece=None if track.piece is None else track.pieces[rows],
    )


def rough_shapes(track: LandmarkTrack, keys: KeyFrames) -> np.ndarray:
    """About where the face is in every frame (F, 66, 2): between found faces of its piece, interpolated."""
    points = track.points_px.copy()
    points[np.searchsorted(track.frames, keys.frames)] = keys.points_px
    shapes = points.copy()
    for number in np.unique(track.pieces):
        own = np.flatnonzero(track.pieces == number)
        shapes[own] = _interpolated(points[own])
    return shapes


def _interpolated(points: np.ndarray) -> np.ndarray:
    """Points (F, 66, 2) with those that are not known, NaN, between those that are; none known: as they are."""
    known = np.flatnonzero(np.isfinite(points).all(axis=(1, 2)))
    if not len(known):
        return points
    rows = np.arange(len(points))
    after = np.clip(np.searchsorted(known, rows), 0, len(known) - 1)
    before = np.clip(np.searchsorted(known, rows, side="right") - 1, 0, len(known) - 1)
    low, high = known[before], known[after]
    part = np.where(high > low, (rows - low) / np.maximum(high - low, 1), 0.0)[:, None, None]
    return (1 - part) * points[low] + part * points[high]


def quality_rows(
    detected: LandmarkTrack, rows: np.ndarray, track: LandmarkTrack, flow: FlowPoints
) -> list[QualityRow]:
    """For each of `rows` (F,): how far the correction moved points, how sure flow and detector are."""
    result = []
    for k, row in enumerate(rows):
        found, good = bool(detected.valid[row]), bool(track.valid[k])
        moved = np.linalg.norm(track.points_px[k] - detected.points_px[row], axis=1).mean()
        figures = {
            "confidence": round(float(track.confidence[k].mean()), 4),
            "flow_confidence": round(float(flow.confidence[k].mean()), 4),
            "correction_px": round(float(moved), 3) if found else np.nan,
        }
        reason = "" if found else FILLED if good else "no face found"
        result.append(QualityRow(int(detected.frames[row]), good, reason, figures))
    return result
