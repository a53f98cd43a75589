"""Distance of the projected lip contours to those found in the picture."""

from __future__ import annotations

import numpy as np

from vermilion.camera import Camera


def distance_to_polyline(points_px: np.ndarray, line_px: np.ndarray, closed: bool) -> np.ndarray:
    """Distance of points (N, 2) to a polyline (M, 2), (N,) px; NaN vertices of it are left out."""
    line = line_px[np.isfinite(line_px).all(axis=1)]
    if len(line) < 2:
        return np.full(len(points_px), np.nan)
    start, end = line, np.roll(line, -1, axis=0)
    if not closed:
        start, end = line[:-1], line[1:]
    along = end - start
    offset = points_px[:, None] - start
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip((offset * along).sum(axis=2) / length, 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1)


def contour_error(
    sequence_mm: np.ndarray,
    camera: Camera,
    loops: list[np.ndarray],
    found_px: list[np.ndarray],
    interocular_px: np.ndarray,
) -> np.ndarray:
    """Mean distance of the contour points in the picture to the projected loops, (F,).

    In pixels per pixel of inter-ocular distance.

    Args:
        sequence_mm: (F, V, 3) in the camera's world.
        loops: closed loops of vertices (the outer and the inner contour).
        found_px: for each loop (F, n, 2) points in the picture; NaN where none was found.
        interocular_px: (F,).
    """
    result = np.full(len(sequence_mm), np.nan)
    for frame, vertices in enumerate(sequence_mm):
        distances = []
        for loop, points in zip(loops, found_px, strict=True):
            seen = points[frame][np.isfinite(points[frame]).all(axis=1)]
            line = camera.project(np.asarray(vertices[loop], dtype=float))
            distances.append(distance_to_polyline(seen, line, closed=True))
        everything = np.concatenate(distances)
        if np.isfinite(everything).any():
            result[frame] = np.nanmean(everything) / interocular_px[frame]
    return result
