"""Contours drawn by a person on a few frames, and the training targets they give."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vermilion.contours.paths import cheapest_path
from vermilion.geometry.polylines import evenly_along, lengths_along
from vermilion.imaging.label_file import check_in_image, load_label, points_of
from vermilion.imaging.sampling import sample_bilinear
from vermilion.imaging.source import Source, folder_of
from vermilion.storage.errors import InputError

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
        return evenly_along(points, max(int(lengths_along(points)[-1] / step_px), 1) + 1)


@dataclass(frozen=True)
class ContourLabel:
    """The two contours of one frame."""

    inner: Polyline
    outer: Polyline


def read_contour_label(path: str | Path, **place) -> ContourLabel:
    """Read one `labels/contours/<camera>/<frame>.json`; raises InputError where it is not so."""
    try:
        data = load_label(Path(path))
        lines = {name: _polyline(name, data.get(name)) for name in CONTOURS}
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(
            f"an unusable contour label ({error})",
            '{"unit": "px", "inner": {"closed": true, "points": [[x, y], ...]}, "outer": ...}',
            "Draw the contour again, or remove the file.",
            path=path,
            **place,
        ) from error
    return ContourLabel(**lines)


def check_contour_label(
    label: ContourLabel, size_px: tuple[int, int], path: str | Path, **place: Any
) -> None:
    """Raise InputError where contours do not lie in their image of `size_px` (width, height)."""
    for line in (label.inner, label.outer):
        check_in_image(line.points_px, size_px, True, path, **place)


def _polyline(name: str, data: object) -> Polyline:
    """Raises ValueError where `data` is no contour."""
    if not isinstance(data, dict):
        raise ValueError(f"no contour '{name}'")
    try:
        points = points_of(data.get("points"))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if len(points) < 2 or not np.ptp(points, axis=0).any():
        raise ValueError(f"{name}: {len(points)} point(s) of no length")
    closed = data.get("closed", True)
    if not isinstance(closed, bool):
        raise ValueError(f"{name}: closed is {closed!r:.20}, not true or false")
    return Polyline(points, closed)


def label_paths(capture: Source, camera: str) -> dict[int, Path]:
    """Frame -> label file of one camera of a capture; empty where there are none."""
    folder = folder_of(capture, "labels") / "contours" / camera
    return {int(path.stem): path for path in sorted(folder.glob("*.json")) if path.stem.isdigit()}


def distance_to(points_px: np.ndarray, size: int, reach_px: float) -> np.ndarray:
    """Distance (size, size) px of each pixel centre of a region to dense `points_px` (n, 2).

    It is infinite from `reach_px` on, as distances that far are most of the pixels and of the time.
    """
    from scipy.spatial import cKDTree  # the workflow asks for `label_paths` at each start

    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    distance, _ = cKDTree(points_px).query(grid, distance_upper_bound=reach_px)
    return distance.reshape(size, size)


def contact_lines(label: ContourLabel, across: np.ndarray) -> list[np.ndarray]:
    """Where lips touch beside a part-open mouth, from each end of the inner contour to its corner.

    `across` (2,) is the direction of the eyes' line in the image. A label names the opening only.
    Segments (2, 2) in image pixels; the line of contact runs
    near them, see `dark_valley`.
    """
    outer, inner = label.outer.points_px, label.inner.points_px
    lines = []
    for sign in (-1.0, 1.0):
        ends = [points[np.argmax(sign * (points @ across))] for points in (inner, outer)]
        lines.append(np.stack(ends))
    return lines


def dark_valley(
    lightness: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    reach_px: float,
    least_contrast: float = 0.015,
) -> np.ndarray:
    """The darkest smooth line (n, 2) px of `lightness` (h, w) between `start` and `end` (2,) px.

    It leaves the straight line by at most `reach_px`, and starts at `start`: lips in contact show
    a dark line from the mouth's opening towards its corner. It ends where it is no darker than
    what lies on either side, so it may be empty (0, 2).
    """
    length = float(np.linalg.norm(end - start))
    if length < 2.0:
        return np.zeros((0, 2))
    along = (end - start) / length
    across = np.array([-along[1], along[0]])
    steps = np.arange(0.0, length + 1e-9, 0.5)
    offsets = np.arange(-reach_px, reach_px + 1e-9, 0.5)
    places = start + steps[:, None, None] * along + offsets[None, :, None] * across
    smooth = cv2.GaussianBlur(lightness.astype(np.float32), (0, 0), 1.0)
    lit = sample_bilinear(smooth, places)
    cost = lit.astype(np.float64) / max(float(np.ptp(lit)), 1e-6)
    cost[0] += np.abs(offsets)  # it starts at the opening
    columns = cheapest_path(cost, np.full(len(steps), 0.1))
    rows, aside = np.arange(len(steps)), round(0.6 * reach_px / 0.5)
    brighter = [lit[rows, np.clip(columns + sign * aside, 0, len(offsets) - 1)] for sign in (-1, 1)]
    contrast = np.minimum(*brighter) - lit[rows, columns]
    contrast = cv2.blur(contrast.astype(np.float32)[:, None], (1, 9)).ravel()
    flat = np.flatnonzero(contrast < least_contrast)
    return places[rows, columns][: flat[0] if len(flat) else None]
