"""Closed curves in a region's pixels, and what lies on them and inside."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.polylines import lengths_along
from vermilion.imaging.sampling import sample_bilinear

#: Points of a curve through a loop.
CURVE_POINTS = 240


def loop_spline(loop_px: np.ndarray, n_points: int = CURVE_POINTS) -> np.ndarray:
    """Closed curve (n_points, 2) through landmarks `loop_px` (n, 2); sharp at the mouth corners.

    The first point and the one farthest from it (the other corner, as the 66-point scheme has
    them) are where the upper and the lower half meet.
    """
    from scipy.interpolate import CubicSpline

    half = int(np.argmax(np.linalg.norm(loop_px - loop_px[0], axis=1)))
    halves = []
    for part in (loop_px[: half + 1], np.concatenate([loop_px[half:], loop_px[:1]])):
        along = lengths_along(part) + np.arange(len(part)) * 1e-6  # landmarks may coincide
        places = np.linspace(0, along[-1], n_points // 2, endpoint=False)
        halves.append(CubicSpline(along, part)(places))
    return np.concatenate(halves)


def smoothed_ring(values: np.ndarray, passes: int) -> np.ndarray:
    """The `values` (n, ...) of a closed ring after binomial smoothing."""
    for _ in range(passes):
        values = 0.25 * np.roll(values, 1, axis=0) + 0.5 * values + 0.25 * np.roll(values, -1, 0)
    return values


def smoothed_halves(ring: np.ndarray, passes: int) -> np.ndarray:
    """The same of a ring (n, 2) whose corners, samples 0 and n / 2, stay."""
    half = len(ring) // 2
    parts = []
    for part in (ring[: half + 1], np.concatenate([ring[half:], ring[:1]])):
        for _ in range(passes):
            middle = 0.25 * part[:-2] + 0.5 * part[1:-1] + 0.25 * part[2:]
            part = np.concatenate([part[:1], middle, part[-1:]])
        parts.append(part[:-1])
    return np.concatenate(parts)


def without_crossing(curve: np.ndarray) -> np.ndarray:
    """A mouth's curve (n, 2), its corners samples 0 and n / 2; halves that pass each other meet instead."""
    half, curve = len(curve) // 2, curve.copy()
    upper, lower = curve[1:half], curve[:half:-1]
    crossed = upper[:, 1] > lower[:, 1]
    middle = 0.5 * (upper + lower)[crossed]
    upper[crossed], lower[crossed] = middle, middle
    return curve


def distance_across(curve: np.ndarray) -> np.ndarray:
    """Distance (n,) of each point of a closed `curve` (n, 2) to the half that it does not belong to."""
    half = len(curve) // 2
    parts = curve[: half + 1], np.concatenate([curve[half:], curve[:1]])
    away = [cKDTree(other).query(part)[0] for part, other in (parts, parts[::-1])]
    return np.concatenate([part[:-1] for part in away])


def sampled(plane: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Bilinear values (n, m) of a plane (h, w) at points (n, m, 2)."""
    return sample_bilinear(plane, points).astype(np.float64)


def of_halves(planes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Values (n, m) at points (n, m, 2) beside a curve: of `planes` (2, h, w) the first for its first half."""
    half = len(points) // 2
    parts = zip(planes, (points[:half], points[half:]), strict=True)
    return np.concatenate([sampled(plane, part) for plane, part in parts])


def inward_normals(ring: np.ndarray, apart: int = 1) -> np.ndarray:
    """Unit normals, as the closed ring (n, 2 or 3), towards its inside in the plane of x and y.

    The tangent is that between the neighbours so many samples `apart` to either side.
    """
    tangent = np.roll(ring, -apart, axis=0) - np.roll(ring, apart, axis=0)
    normal = np.zeros_like(ring, dtype=np.float64)
    normal[:, 0], normal[:, 1] = -tangent[:, 1], tangent[:, 0]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    following = np.roll(ring, -1, axis=0)
    area = np.sum(ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0])
    return normal if area > 0 else -normal


def outward_normals(curve: np.ndarray) -> np.ndarray:
    """Unit normals (n, 2) of a closed `curve` (n, 2) of many points, away from its inside."""
    return -inward_normals(curve, 4)


def inside_and_distance(curve: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Inside of a closed `curve` (n, 2), (size, size) bool, and the distance to it, (size, size), px."""
    away = np.ones((size, size), dtype=np.uint8)
    cv2.polylines(away, [np.rint(curve - 0.5).astype(np.int32)], True, 0)
    distance = cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return inside_of(curve, size), distance


def inside_of(curve: np.ndarray, size: int) -> np.ndarray:
    """Inside of a closed `curve` (n, 2), (size, size) bool."""
    inside = np.zeros((size, size), dtype=np.uint8)
    cv2.fillPoly(inside, [np.rint(curve - 0.5).astype(np.int32)], 1)
    return inside > 0
