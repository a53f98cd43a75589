"""The mouth's region of an image, upright and at one scale whatever the face's size and roll."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.landmarks.scheme import EYE_CORNERS, LIP_INNER, LIP_OUTER, MOUTH, interocular_px

#: Side of the square region, per inter-ocular distance.
SIDE = 1.1


@dataclass(frozen=True)
class MouthRegion:
    """A square of `size_px` pixels round the mouth, the eyes' line horizontal.

    Attributes:
        image_from_region: (2, 3) similarity, region pixels to image pixels (both with the centre
            of the top-left pixel at (0.5, 0.5)).
        size_px: side of the region in its own pixels.
        outer_px, inner_px: (n, 2) loops about the lips in the region: the landmarks', or given ones.
        mask: (size, size) bool, pixels near enough to the mouth to be looked at.
    """

    image_from_region: np.ndarray
    size_px: int
    outer_px: np.ndarray
    inner_px: np.ndarray
    mask: np.ndarray

    @property
    def region_from_image(self) -> np.ndarray:
        """(2, 3) image pixels to region pixels."""
        return cv2.invertAffineTransform(self.image_from_region)

    @property
    def scale(self) -> float:
        """Image pixels per region pixel."""
        return float(np.sqrt(np.abs(np.linalg.det(self.image_from_region[:, :2]))))

    def to_region(self, points_px: np.ndarray) -> np.ndarray:
        """Image pixels `points_px` (N, 2) in the region, (N, 2)."""
        return apply_affine(self.region_from_image, points_px)

    def to_image(self, points_px: np.ndarray) -> np.ndarray:
        """Region pixels `points_px` (N, 2) in the image, (N, 2)."""
        return apply_affine(self.image_from_region, points_px)

    def crop(self, image: np.ndarray) -> np.ndarray:
        """The region of an image (h, w, channels), (size, size, channels); edges repeat."""
        affine = self.image_from_region.copy()
        low, high = self._window(image.shape)
        affine[:, 2] -= low
        part = image[low[1] : high[1], low[0] : high[0]]
        source: np.ndarray = np.ascontiguousarray(part, dtype=np.float32)
        if self.scale > 1.0:  # the image has more detail than the region can hold
            source = cv2.GaussianBlur(source, (0, 0), 0.5 * np.sqrt(self.scale**2 - 0.75))
        return cv2.warpAffine(
            source,
            centred(affine),
            (self.size_px, self.size_px),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )

    def _window(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and past-the-end pixel (x, y) of the part of an image that the region needs."""
        corners = self.to_image(np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * self.size_px)
        margin = 2 + 3 * self.scale
        limit = np.array([shape[1], shape[0]])
        low = np.clip(np.floor(corners.min(axis=0) - margin).astype(int), 0, limit - 1)
        high = np.clip(np.ceil(corners.max(axis=0) + margin).astype(int), low + 1, limit)
        return low, high

    def paste(self, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
        """`values` (size, size) of the region in an image (h, w) of `shape`, zero elsewhere."""
        return cv2.warpAffine(
            np.ascontiguousarray(values, dtype=np.float32),
            centred(self.region_from_image),
            (shape[1], shape[0]),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=0.0,
        )


def mouth_region(
    landmarks_px: np.ndarray,
    interocular_size_px: float,
    margin: float,
    jitter: np.ndarray | None = None,
    lips_px: tuple[np.ndarray, np.ndarray] | None = None,
) -> MouthRegion:
    """The region of a face with landmarks (66, 2).

    Args:
        landmarks_px: (66, 2) image pixels.
        interocular_size_px: inter-ocular distance in the region, that is its resolution.
        margin: width of the band round the landmarks' mouth that is looked at, per
            inter-ocular distance.
        jitter: (2, 2) matrix applied to the region about its centre, to vary training samples.
        lips_px: rings (n, 2), outer and inner, in place of the landmarks' loops.
    """
    landmarks = np.asarray(landmarks_px, dtype=np.float64)
    across = landmarks[EYE_CORNERS[1]] - landmarks[EYE_CORNERS[0]]
    across /= interocular_size_px
    linear = np.array([[across[0], -across[1]], [across[1], across[0]]])
    if jitter is not None:
        linear = linear @ jitter
    mouth = landmarks[MOUTH]
    upright = mouth @ np.linalg.inv(linear).T
    centre = linear @ (0.5 * (upright.min(axis=0) + upright.max(axis=0)))
    size = round(SIDE * interocular_size_px)
    image_from_region = np.column_stack([linear, centre - linear @ np.full(2, size / 2)])
    inverse = cv2.invertAffineTransform(image_from_region)
    loops = (landmarks[LIP_OUTER], landmarks[LIP_INNER]) if lips_px is None else lips_px
    outer, inner = (apply_affine(inverse, loop) for loop in loops)
    mask = _near(outer, size, margin * interocular_size_px)
    return MouthRegion(image_from_region, size, outer, inner, mask)


def usable(landmarks_px: np.ndarray, shape: tuple[int, ...]) -> str:
    """Why `landmarks_px` (66, 2) cannot place a mouth in an image of `shape`; empty if they can."""
    if not np.isfinite(landmarks_px).all():
        return "no landmarks"
    if interocular_px(landmarks_px) < 16:
        return "the face is too small"
    centre = landmarks_px[MOUTH].mean(axis=0)
    if not ((centre >= 0) & (centre < [shape[1], shape[0]])).all():
        return "the mouth is outside the image"
    return ""


def apply_affine(affine: np.ndarray, points: np.ndarray) -> np.ndarray:
    """`points` (..., 2) through an `affine` map (2, 3)."""
    return np.asarray(points, dtype=np.float64) @ affine[:, :2].T + affine[:, 2]


def centred(affine: np.ndarray) -> np.ndarray:
    """The map `affine` (2, 3) for OpenCV, whose pixel centres are whole numbers, (2, 3)."""
    shifted = affine.copy()
    shifted[:, 2] += affine[:, :2] @ [0.5, 0.5] - [0.5, 0.5]
    return shifted


def _near(outer_px: np.ndarray, size: int, margin_px: float) -> np.ndarray:
    filled = np.zeros((size, size), dtype=np.uint8)
    hull = cv2.convexHull(outer_px.astype(np.float32))
    cv2.fillConvexPoly(filled, np.rint(hull).astype(np.int32), 1)
    distance = cv2.distanceTransform(1 - filled, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance <= margin_px
