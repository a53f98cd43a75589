"""Likelihood maps from landmarks, where nobody labelled contours: ridges along their lip loops.

The ridge is drawn about the spline through the landmarks and sharpened by image edges of its
direction, so that its crest moves to the visible border where there is one near.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from vermilion.contours.channels import image_channels
from vermilion.contours.labels import CONTOURS
from vermilion.contours.region import MouthRegion, mouth_region


@dataclass(frozen=True)
class LandmarkRidgeDetector:
    """Gaussian ridges about the landmarks' lip loops.

    Attributes:
        interocular_size_px: inter-ocular distance of the region that is looked at.
        margin: of the region round the mouth, per inter-ocular distance.
        width: deviation of the ridge, per inter-ocular distance.
        sharpening: 0: the ridge alone; 1: where there is no edge the ridge vanishes.
    """

    interocular_size_px: float = 200.0
    margin: float = 0.16
    width: float = 0.022
    sharpening: float = 0.7

    def likelihood(
        self, linear_rgb: np.ndarray, landmarks_px: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `ContourDetector`."""
        region = mouth_region(landmarks_px, self.interocular_size_px, self.margin)
        maps = self.region_likelihood(region.crop(linear_rgb), region)
        inner, outer = (region.paste(maps[name], linear_rgb.shape[:2]) for name in CONTOURS)
        return inner, outer

    def region_likelihood(self, picture: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Name of the contour -> (size, size) likelihood of a cropped region."""
        loops = {"inner": region.inner_px, "outer": region.outer_px}
        channels = image_channels(picture)
        # The vermilion's border shows in its redness, the mouth's opening in lightness.
        edges = {"inner": channels[0], "outer": channels[1] - 0.5 * channels[0]}
        maps = {}
        for name, loop in loops.items():
            distance, normal = _distance_field(loop_spline(loop), region)
            ridge = np.exp(-0.5 * (distance / (self.width * self.interocular_size_px)) ** 2)
            strength = _edge_strength(edges[name], normal, 1.5)
            near = ridge > 0.1
            scale = max(np.percentile(strength[near], 95), 1e-6) if near.any() else 1.0
            edge = np.clip(strength / scale, 0.0, 1.0)
            values = ridge * (1 - self.sharpening + self.sharpening * edge)
            maps[name] = (cv2.GaussianBlur(values.astype(np.float32), (0, 0), 1.0)) * region.mask
        return maps

    def save(self, path: str | Path) -> None:
        """Write `.npz` of plain arrays, whole or not at all."""
        from vermilion.contours.detector import FORMAT_VERSION, save_arrays

        save_arrays(
            path,
            {
                "format_version": FORMAT_VERSION,
                "kind": "landmarks",
                "interocular_size_px": self.interocular_size_px,
                "margin": self.margin,
                "width": self.width,
                "sharpening": self.sharpening,
            },
        )

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> LandmarkRidgeDetector:
        names = ("interocular_size_px", "margin", "width", "sharpening")
        return cls(**{name: float(arrays[name]) for name in names})


def loop_spline(loop_px: np.ndarray, n_points: int = 400) -> np.ndarray:
    """Closed curve through a loop of landmarks (n, 2), (n_points, 2); sharp at the mouth corners.

    The first point and the one farthest from it along the loop's order (the other corner, as the
    66-point scheme has them) are where the upper and the lower half meet.
    """
    n = len(loop_px)
    half = int(np.argmax(np.linalg.norm(loop_px - loop_px[0], axis=1)))
    halves = []
    for part in (loop_px[: half + 1], np.concatenate([loop_px[half:], loop_px[:1]])):
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(part, axis=0), axis=1))])
        along += np.arange(len(along)) * 1e-6  # landmarks may coincide
        places = np.linspace(0, along[-1], n_points // 2, endpoint=False)
        spline = CubicSpline(along, part) if len(part) > 2 else None
        straight = np.stack([np.interp(places, along, part[:, k]) for k in range(2)], axis=1)
        halves.append(spline(places) if spline is not None else straight)
    assert n > 2
    return np.concatenate(halves)


def _distance_field(curve: np.ndarray, region: MouthRegion) -> tuple[np.ndarray, np.ndarray]:
    """Distance (size, size) to the curve, and the curve's unit normal at the nearest point."""
    size = region.size_px
    rows, columns = np.nonzero(region.mask)
    distance, nearest = cKDTree(curve).query(np.stack([columns, rows], axis=1) + 0.5)
    tangent = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    field = np.full((size, size), np.inf)
    normal = np.zeros((size, size, 2))
    field[rows, columns] = distance
    normal[rows, columns] = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)[nearest]
    return field, normal


def _edge_strength(plane: np.ndarray, normal: np.ndarray, sigma: float) -> np.ndarray:
    """Size of the derivative of a channel across the curve."""
    smooth = cv2.GaussianBlur(plane, (0, 0), sigma)
    gx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125)
    gy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125)
    return np.abs(gx * normal[..., 0] + gy * normal[..., 1])
