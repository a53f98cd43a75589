"""Errors of a mesh sequence against its reference, summed by clip so that takes can be joined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from vermilion.correction.surface_quality import SurfaceQuality
from vermilion.evaluation.lips import LipTolerances, aperture_mm
from vermilion.evaluation.masks import Regions
from vermilion.evaluation.reference import Reference
from vermilion.evaluation.statistics import histograms
from vermilion.geometry.closest_points import Surface
from vermilion.storage.progress import progress


@dataclass(frozen=True)
class ClipSums:
    """Sums of one regressor over the frames of each clip; sums of takes are joined end to end.

    Attributes:
        sums: name -> (clips, ...) float64. Names that end in `.max` hold maxima.
    """

    sums: dict[str, np.ndarray] = field(default_factory=dict)

    def __add__(self, other: ClipSums) -> ClipSums:
        """Further sums of the same clips."""
        return ClipSums({**self.sums, **other.sums})

    @staticmethod
    def joined(parts: Iterable[ClipSums]) -> ClipSums:
        """The clips of several takes after one another; only what all of them have."""
        parts = list(parts)
        common = set.intersection(*(set(part.sums) for part in parts))
        return ClipSums(
            {name: np.concatenate([part.sums[name] for part in parts]) for name in sorted(common)}
        )


def vertex_errors(aligned_mm: np.ndarray, reference: Reference) -> np.ndarray:
    """Distance of each vertex of aligned_mm (F, V, 3) to its point, (F, V) mm; NaN without one."""
    return np.linalg.norm(aligned_mm - reference.points_mm, axis=2)


def surface_errors(
    sequences_mm: dict[str, np.ndarray],
    reference: Reference,
    vertices: np.ndarray,
) -> dict[str, np.ndarray]:
    """Distance of each vertex to the nearest point of the reference's surface.

    Args:
        sequences_mm: name -> (F, V, 3) in the reference's world.
        vertices: (V,) bool: which vertices to measure; the others are NaN.

    Returns:
        name -> (F, V) mm.
    """
    ids = np.flatnonzero(vertices)
    errors = {
        name: np.full(sequence.shape[:2], np.nan, dtype=np.float32)
        for name, sequence in sequences_mm.items()
    }
    for frame in progress(range(len(reference.vertices_mm)), "surface errors"):
        surface = Surface(reference.vertices_mm[frame], reference.triangles)
        for name, sequence in sequences_mm.items():
            points = np.asarray(sequence[frame][ids], dtype=np.float64)
            finite = np.isfinite(points).all(axis=1)
            errors[name][frame, ids[finite]] = surface.closest(points[finite]).distance_mm
    return errors


def second_differences(sequence_mm: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """|x[f-1] - 2 x[f] + x[f+1]| of a sequence.

    Args:
        sequence_mm: (F, V, 3), any world, mm.
        frames: (F,) frame numbers.

    Returns:
        (F, V) mm; NaN where a neighbouring frame is missing.
    """
    result = np.full(sequence_mm.shape[:2], np.nan)
    if len(frames) < 3:
        return result
    inner = (np.diff(frames)[:-1] == 1) & (np.diff(frames)[1:] == 1)
    second = sequence_mm[:-2] - 2 * sequence_mm[1:-1] + sequence_mm[2:]
    result[1:-1] = np.where(inner[:, None], np.linalg.norm(second, axis=2), np.nan)
    return result


def sums_of_errors(
    vertex_mm: np.ndarray,
    surface_mm: np.ndarray,
    regions: Regions,
    clips: np.ndarray,
) -> ClipSums:
    """Sums behind vertex and surface errors.

    Args:
        vertex_mm, surface_mm: (F, V) errors, mm; NaN does not count.
        regions: of the V vertices.
        clips: (F,) clip of each frame.
    """
    sums = {}
    for region, weights in regions.weights.items():
        sums[f"{region}.weight"], sums[f"{region}.error"] = weighted_sums(vertex_mm, weights, clips)
        _, sums[f"{region}.square"] = weighted_sums(vertex_mm**2, weights, clips)
        inside = np.where(weights > 0, surface_mm, np.nan)
        sums[f"{region}.histogram"] = by_clip(histograms(inside, weights), clips)
        largest = np.nan_to_num(inside).max(axis=1)
        sums[f"{region}.max"] = by_clip(largest, clips, np.maximum)
    return ClipSums(sums)


def sums_of_jitter(
    aligned_mm: np.ndarray,
    reference: Reference,
    frames: np.ndarray,
    regions: Regions,
    clips: np.ndarray,
) -> ClipSums:
    """Sums behind `jitter_mm`: second differences of the result minus those of the reference.

    Args:
        aligned_mm: (F, V, 3) in the reference's world, mm.
        reference: of the same frames.
        frames: (F,) frame numbers.
        regions: of the V vertices.
        clips: (F,) clip of each frame.
    """
    excess = second_differences(aligned_mm, frames) - second_differences(
        reference.points_mm, frames
    )
    return sums_by_region("jitter", excess, regions, clips)


def sums_of_aperture(
    result_gaps: np.ndarray,
    reference_gaps: np.ndarray,
    clips: np.ndarray,
    tolerances: LipTolerances,
) -> ClipSums:
    """Sums behind `aperture_error_mm` and `false_open_rate`.

    Args:
        result_gaps, reference_gaps: (F, columns) mm, of `lip_gaps`.
        clips: (F,) clip of each frame.
        tolerances: when lips touch and gape.
    """
    difference = np.abs(aperture_mm(result_gaps) - aperture_mm(reference_gaps))
    known = np.isfinite(difference)
    touch = known & (_widest(reference_gaps) <= tolerances.touch_mm)
    gape = touch & (_widest(result_gaps) > tolerances.gape_mm)
    closed = {
        "mouth.touch_frames": by_clip(touch.astype(float), clips),
        "mouth.false_open": by_clip(gape.astype(float), clips),
    }
    return sums_of_frames("mouth.aperture", difference, clips) + ClipSums(closed)


def sums_of_frames(name: str, values: np.ndarray, clips: np.ndarray) -> ClipSums:
    """Sums of one figure a frame, values (F,), by clips (F,); NaN frames do not count."""
    known = np.isfinite(values)
    return ClipSums(
        {
            f"{name}_frames": by_clip(known.astype(float), clips),
            name: by_clip(np.where(known, values, 0.0), clips),
        }
    )


def sums_of_surface(lips: SurfaceQuality, clips: np.ndarray) -> ClipSums:
    """Sums behind `flipped_rate`, `inner_mouth_rate` and `edge_roughness_ratio`, of F frames.

    Args:
        lips: of the same frames.
        clips: (F,) clip of each frame.
    """
    sums = sums_of_frames("vermilion.flipped", lips.flipped.astype(float), clips)
    sums += sums_of_frames("vermilion.inner_mouth", lips.inner_mouth.astype(float), clips)
    rough = {
        "vermilion.roughness": by_clip(lips.roughness_mm, clips),
        "vermilion.base_roughness": by_clip(lips.base_roughness_mm, clips),
    }
    return sums + ClipSums(rough)


def sums_by_region(name: str, values: np.ndarray, regions: Regions, clips: np.ndarray) -> ClipSums:
    """Sums of values (F, V) and of the weights of those known (not NaN), by region and `clips` (F,)."""
    sums = {}
    for region, weights in regions.weights.items():
        known, total = weighted_sums(values, weights, clips)
        sums[f"{region}.{name}_weight"], sums[f"{region}.{name}"] = known, total
    return ClipSums(sums)


def by_clip(values: np.ndarray, clips: np.ndarray, combine: np.ufunc = np.add) -> np.ndarray:
    """Combine values (F, ...) frame by frame into (clips, ...), by clips (F,)."""
    result = np.zeros((int(clips.max()) + 1, *values.shape[1:]))
    combine.at(result, clips, values)
    return result


def weighted_sums(
    values: np.ndarray, weights: np.ndarray, clips: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sum of weights (V,) and of weighted values (F, V) of each clip, (clips,) each, by clips (F,)."""
    finite = np.isfinite(values)
    weight = (finite * weights).sum(axis=1)
    total = (np.where(finite, values, 0.0) * weights).sum(axis=1)
    return by_clip(weight, clips), by_clip(total, clips)


def _widest(gaps: np.ndarray) -> np.ndarray:
    """Largest gap of each frame, (F,); 0 where none is known."""
    return np.nan_to_num(gaps).max(axis=1)
