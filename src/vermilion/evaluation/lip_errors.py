"""Errors of the vermilion alone: its motion, its shape, its worst vertex; summed by clip."""

from __future__ import annotations

import numpy as np

from vermilion.evaluation.errors import ClipSums, sums_by_region, sums_of_frames
from vermilion.evaluation.masks import Regions
from vermilion.evaluation.reference import Reference
from vermilion.geometry.alignment import align_frames


def sums_of_motion_errors(
    sequence_mm: np.ndarray,
    reference: Reference,
    head_rotations: np.ndarray,
    regions: Regions,
    clips: np.ndarray,
) -> ClipSums:
    """Sums behind `lip_motion_error_mm`: each vertex's mean offset over the frames removed, head frame.

    The mean offset is the error of the subject's shape and size; the rest is the error of the motion.

    Args:
        sequence_mm: (F, V, 3) aligned to the reference on the face outside the mouth mask.
        head_rotations: (F, 3, 3) from the reference's world to the head frame.
        regions: of the V vertices.
        clips: (F,) clip of each frame.
    """
    offset = (sequence_mm - reference.points_mm) @ np.swapaxes(head_rotations, 1, 2)
    known = np.isfinite(offset)
    mean = np.where(known, offset, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    errors = np.linalg.norm(offset - mean, axis=2)
    return sums_by_region("motion", errors, regions.only("vermilion"), clips)


def sums_of_shape_errors(
    sequence_mm: np.ndarray, reference: Reference, regions: Regions, clips: np.ndarray
) -> ClipSums:
    """Sums behind `lip_shape_error_mm`: vertex error after one rigid alignment on the mouth alone.

    It compares the shape of the lips without the size and the pose of the head.

    Args:
        sequence_mm: (F, V, 3), any world.
        regions: of the V vertices; `mouth` holds the alignment.
        clips: (F,) clip of each frame.
    """
    motion = align_frames(sequence_mm, reference.points_mm, regions.weights["mouth"])
    errors = np.linalg.norm(motion.apply(sequence_mm) - reference.points_mm, axis=2)
    return sums_by_region("shape", errors, regions.only("vermilion"), clips)


def sums_of_largest_errors(errors_mm: np.ndarray, regions: Regions, clips: np.ndarray) -> ClipSums:
    """Sums behind `lve_mm2`: largest squared vertex error of each frame over the vermilion.

    Args:
        errors_mm: (F, V); NaN does not count.
        regions: of the V vertices.
        clips: (F,) clip of each frame.
    """
    lips = errors_mm[:, regions.weights["vermilion"] > 0]
    known = np.isfinite(lips).any(axis=1)
    largest = np.nan_to_num(lips).max(axis=1, initial=0.0) ** 2
    return sums_of_frames("vermilion.lve", np.where(known, largest, np.nan), clips)
