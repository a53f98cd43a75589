"""Stereo pairs of a rig, found from the cameras alone, and their rectification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vermilion.geometry.camera import Camera, pinhole
from vermilion.imaging.sampling import sample_bilinear
from vermilion.storage.errors import InputError

#: Largest ratio of the resolutions of a pair, and the angles between the rays of a stereo pair.
_DENSITY_RATIO, _STEREO_DEG = 1.5, (2.0, 35.0)


def convergence_deg(a: Camera, b: Camera, target_mm: np.ndarray) -> float:
    """Angle between two cameras' rays to target_mm (3,), world."""
    towards = [target_mm - camera.centre_mm for camera in (a, b)]
    u, v = (t / np.linalg.norm(t) for t in towards)
    return float(np.degrees(np.arccos(np.clip(u @ v, -1, 1))))


def density(camera: Camera, target_mm: np.ndarray) -> float:
    """Pixels a millimetre at target_mm (3,), world."""
    return float(camera.calibration[0, 0] / camera.to_camera(target_mm)[2])


def candidate_pairs(
    cameras: Mapping[str, Camera],
    target_mm: np.ndarray,
    min_angle_deg: float,
    max_angle_deg: float,
) -> list[tuple[str, str]]:
    """All pairs that see target_mm (3,) from similar directions and at similar resolution."""
    pairs = []
    for a, b in combinations(sorted(cameras), 2):
        angle = convergence_deg(cameras[a], cameras[b], target_mm)
        densities = [density(cameras[n], target_mm) for n in (a, b)]
        if min(densities) <= 0 or max(densities) / min(densities) > _DENSITY_RATIO:
            continue
        if min_angle_deg <= angle <= max_angle_deg:
            pairs.append((a, b))
    return pairs


def stereo_pairs(
    cameras: Mapping[str, Camera],
    target_mm: np.ndarray,
    listed: Sequence[tuple[str, str]] = (),
) -> list[tuple[str, str]]:
    """The rig's stereo pairs: those listed, else each camera with its nearest neighbour.

    Args:
        cameras: by name.
        target_mm: (3,) what they look at, world, mm.
        listed: pairs that are used instead.

    Raises:
        InputError: a listed camera does not exist, or no pair is left.
    """
    unknown = sorted({name for pair in listed for name in pair} - set(cameras))
    if unknown:
        raise InputError(
            f"stereo pairs that name {unknown}",
            f"cameras of the rig: {sorted(cameras)}",
            "Correct `multiview.stereo.pairs`.",
        )
    if listed:
        return [(a, b) for a, b in listed]
    candidates = candidate_pairs(cameras, target_mm, *_STEREO_DEG)
    chosen = set()
    for name in cameras:
        mine = [pair for pair in candidates if name in pair]
        if mine:
            angles = [convergence_deg(cameras[a], cameras[b], target_mm) for a, b in mine]
            chosen.add(mine[int(np.argmin(angles))])
    if not chosen:
        raise InputError(
            f"no stereo pair among {sorted(cameras)}",
            f"two cameras within {_STEREO_DEG[1]:g} degrees of each other and of similar resolution",
            "List pairs in `multiview.stereo.pairs`, or bring the cameras closer together.",
        )
    return sorted(chosen)


@dataclass(frozen=True)
class Rectified:
    """A pair turned so that corresponding points lie on the same row.

    Attributes:
        left, right: pinhole cameras of one size, rotation and focal length; their principal points
            differ, so that the target has disparity zero.
        min_disparity_px, n_disparities: range of x_left - x_right that the depth range needs; the
            count is a multiple of 16.
    """

    left: Camera
    right: Camera
    min_disparity_px: int
    n_disparities: int

    @property
    def baseline_mm(self) -> float:
        return float(np.linalg.norm(self.right.centre_mm - self.left.centre_mm))

    def points(self, pixels: np.ndarray, disparity_px: np.ndarray) -> np.ndarray:
        """World points (N, 3) mm of left pixels (N, 2) with disparity_px (N,)."""
        k, k_right = self.left.calibration, self.right.calibration
        offset = k[0, 2] - k_right[0, 2]
        depth = k[0, 0] * self.baseline_mm / (disparity_px - offset)
        local = _directions(k, pixels) * depth[:, None]
        return (local - self.left.translation) @ self.left.rotation


def _directions(calibration: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Viewing directions (..., 3) of pixels (..., 2) in a camera's frame, z = 1."""
    focal, centre = calibration[[0, 1], [0, 1]], calibration[:2, 2]
    return np.concatenate([(pixels - centre) / focal, np.ones_like(pixels[..., :1])], axis=-1)


def rectify(a: Camera, b: Camera, target_mm: np.ndarray, reach_mm: float) -> Rectified:
    """Rectify two pinhole cameras for a scene within `reach_mm` of target_mm (3,), world.

    The rows lie along the baseline, whatever its direction; which camera is left follows from it.
    """
    along = b.centre_mm - a.centre_mm
    forward = a.rotation[2] + b.rotation[2]
    right_axis = along / np.linalg.norm(along)
    forward = forward - (forward @ right_axis) * right_axis
    forward /= np.linalg.norm(forward)
    rotation = np.stack([right_axis, np.cross(forward, right_axis), forward])
    focal = (a.calibration[0, 0] + b.calibration[0, 0]) / 2
    width = height = max(a.width_px, a.height_px, b.width_px, b.height_px)
    cameras = []
    for camera in (a, b):
        pose = np.concatenate([rotation, -(rotation @ camera.centre_mm)[:, None]], axis=1)
        turned = pinhole(camera.name, focal, width, height, pose)
        shift = np.array([width / 2, height / 2]) - turned.project(target_mm)
        params = (focal, focal, width / 2 + shift[0], height / 2 + shift[1])
        cameras.append(Camera(camera.name, "PINHOLE", params, width, height, pose))
    left, right = cameras
    baseline = np.linalg.norm(along)
    depth = left.to_camera(target_mm)[2]
    near, far = depth - reach_mm, depth + reach_mm
    high = focal * baseline * (1 / max(near, 0.1 * depth) - 1 / depth)
    low = focal * baseline * (1 / far - 1 / depth)
    count = int(np.ceil((high - low + 2) / 16) * 16)
    return Rectified(left, right, int(np.floor(low - 1)), count)


def rectified_image(
    original: Camera, image: np.ndarray, turned: Camera
) -> tuple[np.ndarray, np.ndarray]:
    """The image (h, w) of a camera as one of the same centre sees it.

    Returns:
        the image (h', w') of the turned camera, and (h', w') bool of pixels that the original has.
    """
    local = _directions(turned.calibration, turned.pixel_grid())
    in_original = local @ (original.rotation @ turned.rotation.T).T
    ko = original.calibration
    x = in_original[..., 0] / in_original[..., 2] * ko[0, 0] + ko[0, 2]
    y = in_original[..., 1] / in_original[..., 2] * ko[1, 1] + ko[1, 2]
    where = np.stack([x, y], axis=-1)
    rectified = sample_bilinear(image, where, "zero")
    return rectified, original.in_image(where, 1.0) & (in_original[..., 2] > 0)
