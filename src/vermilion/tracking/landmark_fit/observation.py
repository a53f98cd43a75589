"""Observed landmarks against the model's: residuals, their derivatives, their weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.rotations import cross_matrix, left_jacobian, rotation_matrix
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.sets import IBUG66, LandmarkSet
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class LandmarkNoise:
    """Standard deviations of detected landmarks, as fractions of the inter-ocular distance.

    `robust_sigmas`: a landmark this many deviations off counts half (Cauchy).
    """

    jaw: float = 0.05
    brows: float = 0.03
    nose: float = 0.02
    eyes: float = 0.015
    mouth: float = 0.015
    robust_sigmas: float = 3.0

    def per_landmark(self, landmark_set: LandmarkSet = IBUG66) -> np.ndarray:
        """Deviations (N,) of the points of a set, inter-ocular distances."""
        kinds = {name: getattr(self, name) for name in ("jaw", "brows", "nose", "eyes", "mouth")}
        return landmark_set.per_point(kinds)


@dataclass(frozen=True)
class Observations:
    """Landmarks of F frames relative to the principal point of an ideal pinhole camera.

    Attributes:
        image: (F, N, 2) pixels from the principal point; zero where not valid.
        trust: (F, N) confidence in [0, 1]; zero where not valid.
        valid: (F,) bool.
        landmark_set: what the N points are.
    """

    image: np.ndarray
    trust: np.ndarray
    valid: np.ndarray
    landmark_set: LandmarkSet = IBUG66

    @classmethod
    def of(cls, track: LandmarkTrack, camera: Camera) -> Observations:
        """Landmarks without the camera's distortion, x and y scaled to the x focal length."""
        valid = track.valid & np.isfinite(track.points_px).all(axis=(1, 2))
        pixels = np.where(valid[:, None, None], track.points_px, 0.5)
        _, directions = camera.rays(pixels)
        local = directions @ camera.rotation.T
        image = focal_px(camera) * local[..., :2] / local[..., 2:3]
        trust = np.clip(track.confidence, 0.0, 1.0) * valid[:, None]
        image = np.where(valid[:, None, None], image, 0.0)
        return cls(image, trust, valid, track.landmark_set)

    def __getitem__(self, frames: np.ndarray | slice | list[int]) -> Observations:
        """Some frames: a mask (F,) or rows (n,)."""
        return replace(
            self, image=self.image[frames], trust=self.trust[frames], valid=self.valid[frames]
        )


def reprojection_px(image: np.ndarray, seen: Observations) -> np.ndarray:
    """RMS distance (F,) of landmarks in `image` (F, N, 2) from those seen; NaN where there are none.

    Over all landmarks except the jaw's, and those that are hidden.
    """
    compared = seen.landmark_set.compared
    squared = ((image - seen.image) ** 2).sum(axis=-1)[:, compared]
    counts = (seen.trust > 0)[:, compared]
    total = (counts * squared).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)
    return np.where(seen.valid, np.sqrt(total), np.nan)


def require_landmarks(takes: Sequence[Observations]) -> None:
    """Raise InputError where no frame of any take has landmarks."""
    if not any(seen.valid.any() for seen in takes):
        raise InputError(
            "no frame with landmarks",
            "a face in at least one frame",
            "Look at the landmark overlays; check the detector's settings.",
        )


def focal_px(camera: Camera) -> float:
    """The camera's x focal length."""
    return float(camera.calibration[0, 0])


def with_focal(camera: Camera, focal: float | None) -> Camera:
    """The camera with another x focal length (px), its ratio of y to x kept; None changes nothing."""
    if focal is None:
        return camera
    model = camera.colmap()
    ratio = focal / focal_px(camera)
    params = np.array(camera.params, dtype=np.float64)
    params[model.focal_length_idxs()] *= ratio
    return replace(camera, params=tuple(float(p) for p in params))


def project(points_mm: np.ndarray, focal: float | np.ndarray) -> np.ndarray:
    """Pixels (..., 2) from the principal point of `points_mm` (..., 3) in the camera frame.

    `focal` (...,) is in pixels.
    """
    focal = np.asarray(focal)[..., None] if np.ndim(focal) else focal
    return focal * points_mm[..., :2] / points_mm[..., 2:3]


def projection_jacobian(points_mm: np.ndarray, focal: float | np.ndarray) -> np.ndarray:
    """Derivative (..., 2, 3) of `project` by `points_mm` (..., 3); `focal` (...,) in pixels."""
    x, y, z = np.moveaxis(points_mm, -1, 0)
    zero = np.zeros_like(x)
    rows = [[1 / z, zero, -x / z**2], [zero, 1 / z, -y / z**2]]
    jacobian = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return np.asarray(focal)[..., None, None] * jacobian


def whitening(
    points_px: np.ndarray,
    sigma_px: np.ndarray,
    trust: np.ndarray,
    jaw_slide: float,
    jaw_ids: np.ndarray = IBUG66.jaw,
) -> np.ndarray:
    """Matrices (F, N, 2, 2) that turn residuals in pixels into standard deviations.

    Landmarks of the jaw slide along the jaw line: the residual across the line counts in full, the
    residual along it by `jaw_slide` (0 to 1).

    Args:
        points_px: (F, N, 2) projected landmarks of the model.
        sigma_px: (F, N) deviations.
        trust: (F, N) confidence in [0, 1].
        jaw_slide: see above.
        jaw_ids: (J,) landmarks of the jaw's line, in its order.
    """
    scale = np.sqrt(trust) / sigma_px
    result = scale[..., None, None] * np.eye(2)
    jaw = points_px[:, jaw_ids]
    tangent = np.empty_like(jaw)
    tangent[:, 1:-1] = jaw[:, 2:] - jaw[:, :-2]
    tangent[:, 0], tangent[:, -1] = jaw[:, 1] - jaw[:, 0], jaw[:, -1] - jaw[:, -2]
    tangent /= np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), 1e-9)
    along = tangent[..., :, None] * tangent[..., None, :]
    result[:, jaw_ids] = scale[:, jaw_ids, None, None] * (np.eye(2) - (1 - jaw_slide) * along)
    return result


def pose_jacobian(
    vectors: np.ndarray, reference: np.ndarray, points_mm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points turned by exp(v) @ reference, and their derivative by v.

    Args:
        vectors: (F, 3) rotation vectors.
        reference: (3, 3) rotation.
        points_mm: (F, N, 3) in the head frame.

    Returns:
        turned (F, N, 3); derivative (F, N, 3, 3).
    """
    rotation = rotation_matrix(vectors) @ reference
    turned = points_mm @ np.swapaxes(rotation, 1, 2)
    return turned, -cross_matrix(turned) @ left_jacobian(vectors)[:, None]


def robust_weights(deviations: np.ndarray, limit: float) -> np.ndarray:
    """Cauchy weights (F, N) of whitened residuals `deviations` (F, N, 2)."""
    return 1.0 / (1.0 + (deviations**2).sum(axis=-1) / limit**2)


def robust_cost(deviations: np.ndarray, limit: float) -> np.ndarray:
    """Cauchy cost (F, N) of whitened residuals `deviations` (F, N, 2); see `robust_weights`."""
    return 0.5 * limit**2 * np.log1p((deviations**2).sum(axis=-1) / limit**2)
