"""What a person would draw: lip contours and landmarks, from what a camera sees."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.polylines import lengths_along, points_at
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.storage.files import write_text
from vermilion.studio.surface import SKIN, StudioSurface

#: Surface further past the meeting line than this is the inside of the mouth, not the lip (mm).
LIP_DEPTH_MM = 4.0
#: Rays a pixel along each side.
SUBPIXELS = 6
OTHER, UPPER, LOWER, OPENING = range(4)


@dataclass(frozen=True)
class MouthView:
    """What a camera sees round the mouth, finer than its pixels.

    Attributes:
        side: (h, w) uint8 of OTHER, UPPER, LOWER (side of the skin and lips), OPENING.
        red: (h, w) bool, vermilion.
        corner_px: (2,) pixel place of the crop's top-left corner.
    """

    side: np.ndarray
    red: np.ndarray
    corner_px: np.ndarray

    def to_pixels(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Places in the crop to image pixels (N, 2).

        `columns` (N,) and `rows` (N,); cell corners are whole numbers.
        """
        return np.stack([columns, rows], axis=-1) / SUBPIXELS + self.corner_px


def view_mouth(
    model: FaceModel, surface: StudioSurface, vertices_mm: np.ndarray, camera: Camera
) -> MouthView:
    """Cast a fine grid of rays round the lips of a head at `vertices_mm` (V, 3), world."""
    border = camera.project(vertices_mm[model.outer_contour])
    low = np.floor(border.min(axis=0) - 6)
    size = np.ceil(border.max(axis=0) + 6 - low).astype(int) * SUBPIXELS
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    caster = RayCaster(vertices_mm, model.triangles)
    hits = caster.cast(*camera.rays(np.stack([x, y], axis=-1) / SUBPIXELS + low))
    values = np.stack([surface.lip_mm, surface.inside_mm, surface.upper.astype(np.float32)], axis=1)
    lip, inside, upper = np.moveaxis(interpolate(hits, model.triangles, values), -1, 0)
    skin = (surface.material[np.maximum(hits.triangle, 0)] == SKIN) & hits.hit
    outside = skin & (inside < LIP_DEPTH_MM)
    side = np.where(outside, np.where(upper > 0.5, UPPER, LOWER), OPENING)
    side[~hits.hit] = OTHER
    return MouthView(side.astype(np.uint8), outside & (lip > 0), low)


def lip_contours(
    model: FaceModel, surface: StudioSurface, vertices_mm: np.ndarray, camera: Camera
) -> dict[str, np.ndarray]:
    """The lip contours that a camera sees, as closed polylines in pixels.

    `vertices_mm` (V, 3) in the world. `outer` (n, 2) is the visible vermilion border. `inner` (m, 2)
    is the visible border of the mouth's opening; it has no width where the lips touch.
    """
    view = view_mouth(model, surface, vertices_mm, camera)
    corners = camera.project(vertices_mm[model.inner_contour])[:, 0]
    return {"outer": _outer(view), "inner": _inner(view, corners.min(), corners.max())}


def _outer(view: MouthView) -> np.ndarray:
    mask = (view.red | (view.side == OPENING)).astype(np.uint8)
    loops, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    loop = max(loops, key=cv2.contourArea)[:, 0].astype(float) + 0.5
    # The outline runs through the middles of the outermost cells: half a cell too far inside.
    loop += 0.5 * _outward(loop)
    smooth = _smoothed(loop, SUBPIXELS)
    return _resampled(view.to_pixels(smooth[:, 0], smooth[:, 1]), 1.6)


def _inner(view: MouthView, left_px: float, right_px: float) -> np.ndarray:
    """Border of the opening column by column: where the upper lip ends, where the lower begins."""
    first = max(int((left_px - view.corner_px[0]) * SUBPIXELS), 0)
    last = min(int((right_px - view.corner_px[0]) * SUBPIXELS), view.side.shape[1] - 1)
    columns = np.arange(first, last + 1)
    side = view.side[:, first : last + 1]
    upper, lower = side == UPPER, side == LOWER
    good = upper.any(axis=0) & lower.any(axis=0)
    columns, upper, lower = columns[good], upper[:, good], lower[:, good]
    top = len(side) - np.argmax(upper[::-1], axis=0).astype(float)
    bottom = np.argmax(lower, axis=0).astype(float)
    middle = 0.5 * (top + bottom)
    crossed = bottom < top
    top[crossed] = bottom[crossed] = middle[crossed]
    ends = 0.5 * (top + bottom)[[0, -1]]
    columns = columns + 0.5
    over = np.stack([columns, top], axis=1)
    under = np.stack([columns, bottom], axis=1)[::-1]
    left, right = [[columns[0], ends[0]]], [[columns[-1], ends[1]]]
    loop = np.concatenate([left, over, right, under])
    return _resampled(view.to_pixels(loop[:, 0], loop[:, 1]), 1.6)


def _outward(loop: np.ndarray) -> np.ndarray:
    """Unit normals of a closed loop that point away from its inside."""
    along = np.roll(loop, -3, axis=0) - np.roll(loop, 3, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    following = np.roll(loop, -1, axis=0)
    area = (loop[:, 0] * following[:, 1] - loop[:, 1] * following[:, 0]).sum()
    return normal if area > 0 else -normal


def _smoothed(loop: np.ndarray, reach: int) -> np.ndarray:
    """Mean over neighbours of a closed loop, without shrinking it (Taubin)."""
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (0.4 * reach)) ** 2)
    kernel /= kernel.sum()
    for sign in (1.0, -1.02):
        padded = np.concatenate([loop[-reach:], loop, loop[:reach]])
        mean = np.stack([np.convolve(padded[:, c], kernel, "valid") for c in range(2)], axis=1)
        loop = loop + sign * (mean - loop)
    return loop


def _resampled(loop: np.ndarray, step_px: float) -> np.ndarray:
    closed = np.concatenate([loop, loop[:1]])
    length_px = lengths_along(closed)[-1]
    count = max(int(length_px / step_px), 8)
    return points_at(closed, np.linspace(0.0, length_px, count, endpoint=False))


def write_contours(path: str | Path, image: str, loops: dict[str, np.ndarray]) -> None:
    """Write a contour label: closed polylines `loops`, (n, 2) pixels each."""
    content: dict[str, Any] = {"unit": "px", "image": image}
    for name, points in loops.items():
        content[name] = {"closed": True, "points": np.round(points, 2).tolist()}
    write_text(path, json.dumps(content) + "\n")


def write_landmarks(path: str | Path, image: str, points_px: np.ndarray) -> None:
    """Write a landmark label: `points_px` (66, 2)."""
    content = {"unit": "px", "image": image, "points": np.round(points_px, 2).tolist()}
    write_text(path, json.dumps(content) + "\n")
