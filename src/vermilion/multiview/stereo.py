"""Dense matching of rectified pairs, to points in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.mesh import normalised
from vermilion.multiview.pairs import Rectified, rectified_image, rectify
from vermilion.multiview.views import View


@dataclass(frozen=True)
class Cloud:
    """An oriented point cloud.

    Attributes:
        points_mm: (N, 3).
        normals: (N, 3) unit, towards the cameras.
        sigma_mm: (N,) expected error along the viewing ray.
    """

    points_mm: np.ndarray
    normals: np.ndarray
    sigma_mm: np.ndarray

    def __len__(self) -> int:
        return len(self.points_mm)

    def select(self, keep: np.ndarray) -> Cloud:
        """The points of keep: (N,) bool, or ids (n,)."""
        return Cloud(self.points_mm[keep], self.normals[keep], self.sigma_mm[keep])

    @classmethod
    def join(cls, clouds: list[Cloud]) -> Cloud:
        if not clouds:
            return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
        return cls(
            np.concatenate([c.points_mm for c in clouds]),
            np.concatenate([c.normals for c in clouds]),
            np.concatenate([c.sigma_mm for c in clouds]),
        )


@dataclass(frozen=True)
class StereoSettings:
    """Dense matching; see `vermilion.config.multiview` for meanings and units."""

    pairs: Sequence[tuple[str, str]]
    reach_mm: float
    block_px: int
    uniqueness_percent: int
    consistency_px: float
    speckle_px: int
    min_texture: float
    spacing_mm: float


def match_pair(a: View, b: View, target_mm: np.ndarray, settings: StereoSettings) -> Cloud:
    """Match two views by semi-global matching (Hirschmueller 2008) and triangulate.

    Args:
        a, b: views of pinhole cameras.
        target_mm: (3,) world; the scene lies within the settings' reach of it.
        settings: of the matching.

    Returns:
        points in the world, mm.
    """
    pair = rectify(a.camera, b.camera, target_mm, settings.reach_mm)
    left, left_inside = rectified_image(a.camera, a.normalised, pair.left)
    right, right_inside = rectified_image(b.camera, b.normalised, pair.right)
    disparity = _disparity(left, right, pair, settings)
    # the same matcher, right to left, on mirrored images
    mirrored = _disparity(right[:, ::-1], left[:, ::-1], pair, settings)
    back = mirrored[:, ::-1]
    height, width = disparity.shape
    columns = np.arange(width)[None, :]
    there = np.rint(columns - np.nan_to_num(disparity)).astype(int)
    inside = (there >= 0) & (there < width)
    there = np.clip(there, 0, width - 1)
    rows = np.arange(height)[:, None]
    agrees = np.abs(back[rows, there] - disparity) <= settings.consistency_px
    good = agrees & inside & left_inside & right_inside[rows, there]
    good &= _texture(left, settings.block_px) >= settings.min_texture
    kept = np.where(good, disparity, np.float32(pair.min_disparity_px - 1))
    fixed = np.ascontiguousarray(np.rint(kept * 16).astype(np.int16))
    hole = int((pair.min_disparity_px - 1) * 16)
    cv2.filterSpeckles(fixed, hole, settings.speckle_px, 16)
    good = fixed != hole
    smooth = _smoothed(disparity, good)
    return _to_cloud(pair, smooth, good)


def _disparity(left, right, pair: Rectified, settings: StereoSettings):
    """x_left - x_right (h, w) float32, NaN where unmatched. Images are padded by the range."""
    pad, block_px = pair.n_disparities, settings.block_px
    border = [
        cv2.copyMakeBorder(np.ascontiguousarray(p), 0, 0, pad, pad, cv2.BORDER_CONSTANT)
        for p in (left, right)
    ]
    matcher = cv2.StereoSGBM.create(
        minDisparity=pair.min_disparity_px,
        numDisparities=pair.n_disparities,
        blockSize=block_px,
        P1=8 * block_px**2,
        P2=32 * block_px**2,
        disp12MaxDiff=-1,
        preFilterCap=63,
        uniquenessRatio=settings.uniqueness_percent,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    fixed = matcher.compute(*border)[:, pad : pad + left.shape[1]]
    disparity = fixed.astype(np.float32) / 16
    return np.where(fixed >= pair.min_disparity_px * 16, disparity, np.nan)


def _texture(image, block_px):
    value = image.astype(np.float32)
    mean = cv2.blur(value, (block_px, block_px))
    square = cv2.blur(value * value, (block_px, block_px))
    return np.sqrt(np.maximum(square - mean * mean, 0))


def _smoothed(disparity, good, sigma_px: float = 1.2):
    """Mean over matched neighbours: takes out the steps of the sixteenths."""
    weight = cv2.GaussianBlur(good.astype(np.float32), (0, 0), sigma_px)
    value = cv2.GaussianBlur(np.where(good, disparity, 0).astype(np.float32), (0, 0), sigma_px)
    return np.where(good, value / np.maximum(weight, 1e-6), np.nan)


def _to_cloud(pair: Rectified, disparity, good) -> Cloud:
    rows, columns = np.nonzero(good)
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
    points = np.full((*disparity.shape, 3), np.nan)
    points[rows, columns] = pair.points(pixels, disparity[rows, columns].astype(np.float64))
    across = points[:, 2:] - points[:, :-2]
    down = points[2:] - points[:-2]
    normals = np.full_like(points, np.nan)
    normals[1:-1, 1:-1] = normalised(np.cross(down[:, 1:-1], across[1:-1]))
    depth = pair.left.to_camera(points[rows, columns])[:, 2]
    focal = pair.left.calibration[0, 0]
    sigma = 0.25 * depth**2 / (focal * pair.baseline_mm)
    cloud = Cloud(points[rows, columns], normals[rows, columns], sigma)
    return cloud.select(np.isfinite(cloud.normals).all(axis=1))
