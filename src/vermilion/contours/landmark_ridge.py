"""Likelihood maps where nobody labelled contours: from the landmarks' lip loops and the picture.

The spline through each loop is moved to the border of the lips' colour, as one smooth ring near
the landmarks, and a ridge is drawn about it. What is lip-coloured is learnt in each frame by
itself, from the band between the loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from vermilion.contours.channels import image_channels
from vermilion.contours.detector import ContourDetector
from vermilion.contours.paths import cheapest_ring
from vermilion.contours.region import MouthRegion

STEP_PX = 0.5  # between the places along a normal, region pixels


@dataclass(frozen=True)
class LandmarkRidgeDetector(ContourDetector):
    """Ridges about the lips' borders near the landmarks.

    Attributes:
        interocular_size_px: inter-ocular distance of the region that is looked at.
        margin: of the region round the mouth, per inter-ocular distance.
        width: deviation of the ridge, per inter-ocular distance.
        reach: a border farther from the landmarks is not looked for, per inter-ocular distance.
        edge_weight: what the strongest edge is worth against the landmarks; 0: landmarks alone.
        stiffness: cost of a slope of 1 of the moved ring against the spline, squared.
    """

    interocular_size_px: float = 200.0
    margin: float = 0.16
    width: float = 0.008
    reach: float = 0.08
    edge_weight: float = 4.0
    stiffness: float = 6.0

    def region_likelihood(self, picture: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Name of the contour -> (size, size) likelihood of a cropped region."""
        planes = lip_planes(image_channels(picture)[:3], region)
        loops = {"inner": region.inner_px, "outer": region.outer_px}
        maps = {}
        for name, loop in loops.items():
            curve = loop_spline(loop)
            reach = self.reach * self.interocular_size_px * (1.0 if name == "outer" else 0.6)
            curve, strength = self._moved(curve, planes[name], reach)
            maps[name] = self._ridge(curve, strength, region)
        return maps

    def _moved(
        self, curve: np.ndarray, plane: np.ndarray, reach_px: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The curve on the strongest fall of `plane` near it, and the fall (n,) in [0, 1]."""
        normals = _outward_normals(curve)
        places = np.arange(-reach_px, reach_px + 1e-9, STEP_PX)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        x, y = (np.ascontiguousarray(points[..., k] - 0.5, dtype=np.float32) for k in range(2))
        profile = cv2.remap(plane, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        fall = np.maximum(-np.gradient(profile.astype(np.float64), STEP_PX, axis=1), 0.0)
        fall = np.minimum(fall / max(np.percentile(fall.max(axis=1), 75), 1e-6), 1.0)
        cost = (places / reach_px) ** 2 - self.edge_weight * fall
        apart = np.linalg.norm(np.roll(curve, -1, axis=0) - curve, axis=1)
        chosen = cheapest_ring(cost, self.stiffness * (STEP_PX / np.maximum(apart, STEP_PX)) ** 2)
        rows = np.arange(len(curve))
        moved = curve + places[chosen][:, None] * normals
        for _ in range(2):
            moved = 0.25 * np.roll(moved, 1, axis=0) + 0.5 * moved + 0.25 * np.roll(moved, -1, 0)
        return moved, fall[rows, chosen]

    def _ridge(self, curve: np.ndarray, strength: np.ndarray, region: MouthRegion) -> np.ndarray:
        dense = np.concatenate([curve + t * (np.roll(curve, -1, 0) - curve) for t in (0.0, 0.5)])
        strength = np.concatenate([strength, strength])
        rows, columns = np.nonzero(region.mask)
        distance, nearest = cKDTree(dense).query(np.stack([columns, rows], axis=1) + 0.5)
        width = self.width * self.interocular_size_px
        values = np.zeros(region.mask.shape, dtype=np.float32)
        values[rows, columns] = (0.4 + 0.6 * strength[nearest]) * np.exp(
            -0.5 * (distance / width) ** 2
        )
        return values

    def save(self, path: str | Path) -> None:
        """Write `.npz` of plain arrays, whole or not at all."""
        from vermilion.contours.detector import FORMAT_VERSION, save_arrays

        names = ("interocular_size_px", "margin", "width", "reach", "edge_weight", "stiffness")
        arrays = {name: getattr(self, name) for name in names}
        save_arrays(path, {"format_version": FORMAT_VERSION, "kind": "landmarks", **arrays})

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> LandmarkRidgeDetector:
        names = ("interocular_size_px", "margin", "width", "reach", "edge_weight", "stiffness")
        return cls(**{name: float(arrays[name]) for name in names})


def lip_planes(lab: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
    """Two (size, size) float32 planes in [0, 1] that fall outwards across each contour.

    `outer`: probability of lip against skin, of two normal distributions with one covariance
    (linear discriminant) in the colour channels `lab` (3, size, size). `inner`: how far the colour
    is from the lips', which is high in the mouth's opening, on teeth and on the dark line of a
    closed mouth.
    """
    smooth = np.stack([cv2.GaussianBlur(plane, (0, 0), 1.2) for plane in lab])
    inside, to_outer = _drawn(region.outer_px, region.size_px)
    opening, to_inner = _drawn(region.inner_px, region.size_px)
    ratio = to_outer / np.maximum(to_outer + to_inner, 1e-9)
    lip = inside & ~opening & (ratio > 0.3) & (ratio < 0.7)
    scale = region.size_px / 1.1
    skin = ~inside & (to_outer > 0.05 * scale) & (to_outer < 0.12 * scale)
    if lip.sum() < 20 or skin.sum() < 20:
        return {"inner": np.zeros_like(lab[0]), "outer": np.zeros_like(lab[0])}
    lips, skins = smooth[:, lip].T.astype(np.float64), smooth[:, skin].T.astype(np.float64)
    own = _covariance(lips)
    shared = 0.5 * (own + _covariance(skins))
    direction = np.linalg.solve(shared, lips.mean(axis=0) - skins.mean(axis=0))
    middle = 0.5 * (lips.mean(axis=0) + skins.mean(axis=0))
    log_odds = np.tensordot(direction, smooth - middle[:, None, None], axes=1)
    away = smooth.reshape(3, -1).T - lips.mean(axis=0)
    squared = np.einsum("nk,kl,nl->n", away, np.linalg.inv(own), away).reshape(lab.shape[1:])
    return {
        "outer": (1.0 / (1.0 + np.exp(-np.clip(log_odds, -30, 30)))).astype(np.float32),
        "inner": (1.0 - np.exp(-squared / 18.0)).astype(np.float32),
    }


def loop_spline(loop_px: np.ndarray, n_points: int = 240) -> np.ndarray:
    """Closed curve through a loop of landmarks (n, 2), (n_points, 2); sharp at the mouth corners.

    The first point and the one farthest from it (the other corner, as the 66-point scheme has
    them) are where the upper and the lower half meet.
    """
    half = int(np.argmax(np.linalg.norm(loop_px - loop_px[0], axis=1)))
    halves = []
    for part in (loop_px[: half + 1], np.concatenate([loop_px[half:], loop_px[:1]])):
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(part, axis=0), axis=1))])
        along += np.arange(len(along)) * 1e-6  # landmarks may coincide
        places = np.linspace(0, along[-1], n_points // 2, endpoint=False)
        halves.append(CubicSpline(along, part)(places))
    return np.concatenate(halves)


def _outward_normals(curve: np.ndarray) -> np.ndarray:
    tangent = np.roll(curve, -4, axis=0) - np.roll(curve, 4, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    following = np.roll(curve, -1, axis=0)
    area = np.sum(curve[:, 0] * following[:, 1] - curve[:, 1] * following[:, 0])
    return normal if area > 0 else -normal


def _drawn(loop_px: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Inside of a loop (size, size) bool, and the distance to it to a pixel."""
    points = [np.rint(loop_spline(loop_px) - 0.5).astype(np.int32)]
    inside, away = np.zeros((size, size), dtype=np.uint8), np.ones((size, size), dtype=np.uint8)
    cv2.fillPoly(inside, points, 1)
    cv2.polylines(away, points, True, 0)
    return inside > 0, cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _covariance(samples: np.ndarray) -> np.ndarray:
    return np.cov(samples.T) + 1e-5 * np.eye(samples.shape[1])
