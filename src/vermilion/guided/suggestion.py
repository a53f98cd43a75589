"""Frames worth correcting: those whose mouths span what the others do.

Guided18 chooses extremes by hand and names an automatic choice as future work (section 7). The error
of a propagated frame lies where its trusted gradients leave the span of the corrected frames', so the
next frame to correct is the one whose direction takes most of what is left of all frames. Lengths are
summed, not their squares: one wild frame is not worth ten common ones.
"""

from __future__ import annotations

import numpy as np

from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.mesh import triangle_areas
from vermilion.guided.gradients import NeutralTriangles
from vermilion.guided.regions import GuidedRegions
from vermilion.storage.errors import InputError

#: Triangles that describe a mouth well enough to compare frames.
N_TRIANGLES = 2000
_LEAST_LEFT = 1e-9
_SWEEPS = 4


def mouth_deformation(
    sequence_mm: np.ndarray,
    neutral_mm: np.ndarray,
    regions: GuidedRegions,
    stable: np.ndarray | None = None,
    n_triangles: int = N_TRIANGLES,
) -> np.ndarray:
    """Trusted gradients less the neutral's, weighted by area, (F, 9 m') float32.

    Args:
        sequence_mm: (F, V, 3), any rigid poses.
        neutral_mm: (V, 3).
        stable: (s,) vertices that hold the alignment (as for `LipPropagator`).
        n_triangles: at most so many of the trusted triangles, evenly spread over their list.
    """
    step = max(1, -(-len(regions.trusted) // n_triangles))
    chosen = regions.triangles[regions.trusted[::step]]
    stable = np.unique(regions.triangles[regions.trusted]) if stable is None else stable
    neutral = np.asarray(neutral_mm, dtype=np.float64)
    triangles = NeutralTriangles(neutral, chosen)
    area = triangle_areas(neutral, chosen)
    weight = np.repeat(np.sqrt(area / area.sum()), 9)
    rest = triangles.gradients(neutral[None])
    result = np.empty((len(sequence_mm), 9 * len(chosen)), dtype=np.float32)
    for f, mesh in enumerate(sequence_mm):
        mesh = np.asarray(mesh, dtype=np.float64)
        aligned = similarity_alignment(mesh[stable], neutral[stable], scale=1.0).apply(mesh)
        result[f] = ((triangles.gradients(aligned[None]) - rest) * weight)[0]
    return result


def suggest_frames(
    deformation: np.ndarray,
    count: int,
    corrected: np.ndarray | None = None,
    allowed: np.ndarray | None = None,
) -> np.ndarray:
    """The next frames to correct, best first, (count,) or fewer where nothing is left.

    Greedy: each time the frame after whose correction the unexplained lengths of all frames have
    the least sum. Then each suggestion is exchanged for a better one, as long as there is any.

    Args:
        deformation: (F, D) of `mouth_deformation`.
        corrected: (k,) frames corrected already: their span is explained.
        allowed: (F,) bool, frames that may be suggested (not flagged, seen by a camera).

    Raises:
        InputError: more frames than there are.
    """
    n_frames = len(deformation)
    _check_count(n_frames, count)
    values = np.asarray(deformation, dtype=np.float64)
    left = values @ values.T
    least = _LEAST_LEFT * max(np.diagonal(left).max(), 1e-300)
    may = np.ones(n_frames, dtype=bool) if allowed is None else np.array(allowed, dtype=bool)
    for frame in np.zeros(0, dtype=int) if corrected is None else np.asarray(corrected):
        left = _without(left, int(frame), least)
        may[frame] = False
    chosen = _greedy(left, count, may, least)
    for _ in range(_SWEEPS):
        exchanged = _exchanged(left, chosen, may, least)
        if exchanged == chosen:
            break
        chosen = exchanged
    only = np.zeros(n_frames, dtype=bool)
    only[chosen] = True
    return np.array(_greedy(left, len(chosen), only, least), dtype=np.int64)


def unexplained_share(deformation: np.ndarray, corrected: np.ndarray) -> np.ndarray:
    """Share of each frame's deformation outside the span of the corrected frames, (F,) in [0, 1]."""
    values = np.asarray(deformation, dtype=np.float64)
    whole = np.linalg.norm(values, axis=1)
    basis = np.linalg.svd(values[corrected], full_matrices=False)
    directions = basis[2][basis[1] > 1e-7 * max(basis[1].max(initial=0.0), 1e-300)]
    left = np.linalg.norm(values - (values @ directions.T) @ directions, axis=1)
    return np.divide(left, whole, out=np.zeros_like(whole), where=whole > 0)


def extreme_frames(deformation: np.ndarray, count: int) -> np.ndarray:
    """The frames (count,) of the largest deformation (F, D), largest first: the paper's extremes."""
    _check_count(len(deformation), count)
    return np.argsort(-np.linalg.norm(deformation, axis=1), kind="stable")[:count]


def uniform_frames(n_frames: int, count: int) -> np.ndarray:
    """Frames (count,) evenly spread over the take, the middle of each of equal parts."""
    _check_count(n_frames, count)
    return ((np.arange(count) + 0.5) * n_frames / count).astype(np.int64)


def random_frames(n_frames: int, count: int, seed: int) -> np.ndarray:
    """Frames (count,) drawn without repetition, ascending."""
    _check_count(n_frames, count)
    return np.sort(np.random.default_rng([seed, 1840]).permutation(n_frames)[:count])


def _greedy(left: np.ndarray, count: int, may: np.ndarray, least: float) -> list[int]:
    """Frames, each the best after those before it; fewer than `count` where nothing is left."""
    chosen: list[int] = []
    may = may.copy()
    while len(chosen) < count:
        score = _remaining(left, may, least)
        frame = int(score.argmin())
        if not np.isfinite(score[frame]):
            break
        chosen.append(frame)
        may[frame] = False
        left = _without(left, frame, least)
    return chosen


def _exchanged(left: np.ndarray, chosen: list[int], may: np.ndarray, least: float) -> list[int]:
    """The same set with each frame in turn replaced by the best beside the others."""
    chosen = list(chosen)
    for index, frame in enumerate(chosen):
        rest, others = left, may.copy()
        for other in chosen[:index] + chosen[index + 1 :]:
            rest = _without(rest, other, least)
            others[other] = False
        score = _remaining(rest, others, least)
        best = int(score.argmin())
        if score[best] < score[frame] * (1.0 - 1e-9):
            chosen[index] = best
    return chosen


def _remaining(left: np.ndarray, may: np.ndarray, least: float) -> np.ndarray:
    """Sum over all frames of the unexplained lengths after each frame's correction, (F,).

    Infinite where a frame may not be chosen or has nothing to add.
    """
    own = np.diagonal(left)
    result = np.full(len(left), np.inf)
    for frame in np.flatnonzero(may & (own > least)):
        after = np.maximum(own - left[frame] ** 2 / own[frame], 0.0)
        result[frame] = np.sqrt(after).sum()
    return result


def _without(left: np.ndarray, frame: int, least: float) -> np.ndarray:
    """Inner products of the frames' parts that are orthogonal to one frame's part."""
    own = left[frame, frame]
    return left - np.outer(left[frame], left[frame]) / own if own > least else left


def _check_count(n_frames: int, count: int) -> None:
    if not 0 < count <= n_frames:
        raise InputError(
            f"{count} frames to choose of {n_frames}",
            f"a number from 1 to {n_frames}",
            "Ask for fewer frames, or give a longer take.",
        )
