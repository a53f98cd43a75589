"""The corrected head laid on the image again: a rigid motion a frame.

A layer corrects the lips beside the rest of the coarse face, and the coarse face was laid on the
image with lips of its own. Where its proportions or its distance are a little off, the true lips
beside it no longer project on the image's. So the corrected head moves rigidly, until its lip
contours lie on those found (point to line) while eyes and brows stay where the tracker saw them. The
motion is small and slow (it makes up for the person's proportions), so it is smoothed over time by a
filter without lag.
"""

from __future__ import annotations

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.rotations import rotation_matrix

#: Landmarks that stay where they are in the image: brows and eyes.
ANCHORS = np.r_[17:27, 36:48]
#: Deviations: of the motion (rotation in rad, shift across and along the view in mm) ...
_TURN, _ACROSS_MM, _ALONG_MM = 0.05, 10.0, 40.0
#: ... of an anchor and of a contour point, per inter-ocular distance.
_ANCHOR, _CONTOUR = 0.01, 0.01
#: Points of one kind count together as this many independent ones.
_INDEPENDENT = 20.0
_STEPS = 6


def repose_motion(
    anchors_mm: np.ndarray,
    anchors_px: np.ndarray,
    samples_mm: np.ndarray,
    lines: tuple[np.ndarray, np.ndarray, np.ndarray],
    pivot_mm: np.ndarray,
    unit_px: np.ndarray,
    camera: Camera,
) -> np.ndarray:
    """Small motion (F, 6) in the world: rotation vector about the pivot (rad), shift (mm).

    Robust Gauss-Newton from no motion, all frames together.

    Args:
        anchors_mm: (F, a, 3) world.
        anchors_px: (F, a, 2) where they belong.
        samples_mm: (F, m, 3) contour samples, world.
        lines: of `ImageContours.lines`, (F, m, ...).
        pivot_mm: (F, 3).
        unit_px: (F,) inter-ocular distance.
    """
    points_px, normals, known = lines
    points = np.concatenate([anchors_mm, samples_mm], axis=1)
    a, n_frames = anchors_mm.shape[1], len(points)
    prior = np.zeros((6, 6))
    prior[:3, :3] = np.eye(3) / _TURN**2
    deviations = np.array([_ACROSS_MM, _ACROSS_MM, _ALONG_MM])
    prior[3:, 3:] = camera.rotation.T @ np.diag(deviations**-2) @ camera.rotation
    motion = np.zeros((n_frames, 6))
    unit = unit_px[:, None]
    known = known * (_INDEPENDENT / np.maximum(known.sum(axis=1, keepdims=True), 1))
    for _ in range(_STEPS):
        world = apply_motion(points, pivot_mm, motion)
        arm = world - (pivot_mm + motion[:, 3:])[:, None]
        slope = camera.pixel_jacobian(world) / unit[..., None, None]
        rows = np.concatenate([np.cross(arm[:, :, None], slope), slope], axis=3)
        seen = camera.project(world)
        off = (anchors_px - seen[:, :a]) / unit[..., None]
        beside = ((points_px - seen[:, a:]) * normals).sum(axis=2) / unit
        across = np.einsum("fmk,fmkj->fmj", normals, rows[:, a:])
        held = rows[:, :a]
        w_held = _robust((off**2).sum(axis=2), _ANCHOR) * (_INDEPENDENT / a)
        w_line = _robust(beside**2, _CONTOUR) * known
        matrix = prior + np.einsum("fa,faki,fakj->fij", w_held, held, held)
        matrix += np.einsum("fm,fmi,fmj->fij", w_line, across, across)
        right = np.einsum("fa,faki,fak->fi", w_held, held, off) - motion @ prior
        right += np.einsum("fm,fmi,fm->fi", w_line, across, beside)
        motion = motion + np.linalg.solve(matrix, right[..., None])[..., 0]
    return motion


def smoothed_motion(
    motion: np.ndarray, known: np.ndarray, frames: np.ndarray, deviation: float
) -> np.ndarray:
    """`motion` (F, 6) after a symmetric filter over the `known` frames (F,) bool; 0 without any near.

    Args:
        frames: (F,) frame numbers; a frame that is not there does not count.
        deviation: of the Gaussian in frames, cut at three of them; 0 leaves known frames alone.
    """
    apart = np.abs(np.subtract.outer(frames, frames)).astype(float)
    if deviation > 0:
        weight = np.exp(-0.5 * (apart / deviation) ** 2)
        weight[apart > np.ceil(3 * deviation)] = 0.0
    else:
        weight = (apart == 0).astype(float)
    weight *= known
    total = weight.sum(axis=1, keepdims=True)
    return np.divide(weight @ np.where(known[:, None], motion, 0.0), total, where=total > 0,
                     out=np.zeros_like(motion))  # fmt: skip


def apply_motion(points_mm: np.ndarray, pivot_mm: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """World points `points_mm` (F, m, 3) after the `motion` (F, 6) about `pivot_mm` (F, 3), world."""
    turned = (points_mm - pivot_mm[:, None]) @ np.swapaxes(rotation_matrix(motion[:, :3]), 1, 2)
    return turned + (pivot_mm + motion[:, 3:])[:, None]


def _robust(squared: np.ndarray, deviation: float) -> np.ndarray:
    """Weights by Cauchy's law: three deviations off count half."""
    return 1.0 / (deviation**2 + squared / 9.0)
