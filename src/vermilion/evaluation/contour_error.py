"""Distance of the projected lip contours to those found in the image."""

from __future__ import annotations

import numpy as np

from vermilion.features.occluding import OccludingContour
from vermilion.geometry.camera import Camera


def distance_to_polyline(points_px: np.ndarray, line_px: np.ndarray, closed: bool) -> np.ndarray:
    """Distance (N,) px of `points_px` (N, 2) to a polyline `line_px` (M, 2), without its NaN vertices."""
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
    outer_loop: np.ndarray,
    occluding: OccludingContour | None,
    outer_px: np.ndarray,
    inner_px: np.ndarray,
    interocular_px: np.ndarray,
) -> np.ndarray:
    """Mean distance of the contour points in the image to the mesh's contours, (F,).

    In pixels per pixel of inter-ocular distance. The outer contour is a loop of the mesh. The inner
    one is what hides the mouth: of each point in the image, how much higher or lower that is.

    Args:
        sequence_mm: (F, V, 3) in the camera's world.
        outer_loop: (L,) vertices of a closed loop.
        occluding: of the same topology; None: the outer contour alone.
        outer_px, inner_px: (F, n, 2) rings in the image; NaN where none was found.
        interocular_px: (F,).
    """
    result = np.full(len(sequence_mm), np.nan)
    for frame, vertices in enumerate(np.asarray(sequence_mm, dtype=float)):
        outer, inner = outer_px[frame], inner_px[frame]
        seen = outer[np.isfinite(outer).all(axis=1)]
        distances = [distance_to_polyline(seen, camera.project(vertices[outer_loop]), closed=True)]
        if occluding is not None and np.isfinite(outer).all():
            pixels = camera.project(occluding.on(vertices))
            known = np.isfinite(inner).all(axis=1)
            samples, points, up = occluding.match(pixels, outer, inner, known)
            distances.append(np.abs((inner[samples] - pixels[points]) @ up))
        everything = np.concatenate(distances)
        if np.isfinite(everything).any():
            result[frame] = np.nanmean(everything) / interocular_px[frame]
    return result
