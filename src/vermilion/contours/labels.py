"""Contours drawn by a person on a few frames, and the training targets they give."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vermilion.errors import InputError

CONTOURS = ("inner", "outer")


@dataclass(frozen=True)
class Polyline:
    """(n, 2) image pixels; closed or not (the inner contour of a closed mouth is open)."""

    points_px: np.ndarray
    closed: bool

    def dense(self, step_px: float = 0.25) -> np.ndarray:
        """Points at most `step_px` apart along it, (m, 2)."""
        points = self.points_px
        if self.closed:
            points = np.concatenate([points, points[:1]])
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(lengths)])
        places = np.linspace(0.0, along[-1], max(int(along[-1] / step_px), 1) + 1)
        return np.stack([np.interp(places, along, points[:, k]) for k in range(2)], axis=1)


@dataclass(frozen=True)
class ContourLabel:
    """The two contours of one frame."""

    inner: Polyline
    outer: Polyline


def read_label(path: str | Path, **place) -> ContourLabel:
    """Read one `labels/contours/<camera>/<frame>.json`; raises InputError where it is not so."""
    try:
        data = json.loads(Path(path).read_text())
        lines = {}
        for name in CONTOURS:
            points = np.asarray(data[name]["points"], dtype=np.float64)
            if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
                raise ValueError(f"{name}: points of shape {points.shape}")
            if not np.isfinite(points).all():
                raise ValueError(f"{name}: a point is not a number")
            lines[name] = Polyline(points, bool(data[name].get("closed", True)))
        if data.get("unit", "px") != "px":
            raise ValueError(f"unit {data['unit']}")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"an unusable contour label ({type(error).__name__}: {error})",
            '{"unit": "px", "inner": {"closed": true, "points": [[x, y], ...]}, "outer": ...}',
            "Draw the contour again, or remove the file.",
            path=path,
            **place,
        ) from error
    return ContourLabel(**lines)


def label_paths(capture: str | Path, camera: str) -> dict[int, Path]:
    """Frame -> label file of one camera of a capture folder; empty where there are none."""
    folder = Path(capture) / "labels" / "contours" / camera
    return {int(path.stem): path for path in sorted(folder.glob("*.json")) if path.stem.isdigit()}


def distance_to(points_px: np.ndarray, size: int) -> np.ndarray:
    """Distance of each pixel centre of a (size, size) region to dense points (n, 2), in pixels."""
    from scipy.spatial import cKDTree

    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    distance, _ = cKDTree(points_px).query(grid)
    return distance.reshape(size, size)


def contact_lines(label: ContourLabel) -> list[np.ndarray]:
    """Where lips touch beside a part-open mouth, from each end of the inner contour to its corner.

    A label names the opening only; whether the line of contact is inner contour is undecided, so
    training leaves it out. Segments (2, 2) in image pixels.
    """
    outer, inner = label.outer.points_px, label.inner.points_px
    axis = _mouth_axis(outer)
    lines = []
    for sign in (-1.0, 1.0):
        ends = [points[np.argmax(sign * (points @ axis))] for points in (inner, outer)]
        lines.append(np.stack(ends))
    return lines


def _mouth_axis(outer_px: np.ndarray) -> np.ndarray:
    hull = cv2.convexHull(outer_px.astype(np.float32))[:, 0].astype(np.float64)
    apart = hull[:, None] - hull[None]
    i, j = np.unravel_index(np.argmax((apart**2).sum(axis=-1)), apart.shape[:2])
    axis = hull[i] - hull[j]
    return axis / np.linalg.norm(axis)
