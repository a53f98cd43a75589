"""Image pyramid of the face: a few resolutions, sampled between pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.sampling import sample_bilinear
from vermilion.imaging.undistortion import undistorted
from vermilion.tracking.landmark_fit.observation import focal_px

_MARGIN_MM = 12.0


@dataclass(frozen=True)
class PyramidLevel:
    """One resolution. Places are pixels of an ideal pinhole camera with the camera's x focal length.

    Attributes:
        colours: (h, w, 3) float32 linear RGB.
        slopes_x, slopes_y: (h, w, 3) float32 derivatives, per pixel of the level.
        origin: (2,) the upper left corner, from the principal point.
        step: (2,) width and height of a pixel of the level.
    """

    colours: np.ndarray
    slopes_x: np.ndarray
    slopes_y: np.ndarray
    origin: np.ndarray
    step: np.ndarray

    def sample(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Colours and derivatives at `places` (N, 2), pixels from the principal point.

        Returns:
            values (N, 3); derivatives (N, 3, 2) per pixel of the ideal camera; inside (N,) bool.
        """
        pixels = (places - self.origin) / self.step
        height, width = self.colours.shape[:2]
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= 0.5) & (pixels <= [width - 0.5, height - 0.5])).all(axis=1)
        pixels = np.where(inside[:, None], pixels, 0.5)
        found = [
            sample_bilinear(part, pixels) for part in (self.colours, self.slopes_x, self.slopes_y)
        ]
        slopes = np.stack([found[1] / self.step[0], found[2] / self.step[1]], axis=-1)
        return found[0], slopes, inside


def image_pyramid(
    image: np.ndarray,
    camera: Camera,
    points_mm: np.ndarray,
    pixel_mm: float,
    count: int,
) -> list[PyramidLevel]:
    """The image around some points, finest level first.

    Args:
        image: (h, w, 3) linear RGB.
        camera: of the image.
        points_mm: (N, 3), camera frame.
        pixel_mm: size of a pixel of the finest level at the points' mean depth; never finer than
            the image itself.
        count: of levels, each half as fine as the one before.
    """
    focal = focal_px(camera)
    depth = float(points_mm[:, 2].mean())
    places = focal * points_mm[:, :2] / points_mm[:, 2:3]
    margin = focal * _MARGIN_MM / depth
    low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
    flat, origin, size = _ideal(image, camera, low, high)
    wanted = max(focal * pixel_mm / depth, 1.0)
    levels = []
    for index in range(count):
        shape = np.maximum(np.rint(size / (wanted * 2.0**index)), 4).astype(int)
        if index == 0:
            small = cv2.resize(flat, tuple(int(n) for n in shape), interpolation=cv2.INTER_AREA)
        else:
            small = cv2.resize(
                cv2.GaussianBlur(small, (0, 0), 0.8),
                tuple(int(n) for n in shape),
                interpolation=cv2.INTER_AREA,
            )
        soft = cv2.GaussianBlur(small, (0, 0), 0.7)
        slope_x, slope_y = (
            cv2.Sobel(soft, cv2.CV_32F, *axis, ksize=3, scale=0.125) for axis in ((1, 0), (0, 1))
        )
        levels.append(PyramidLevel(soft, slope_x, slope_y, origin, size / shape))
    return levels


def _ideal(image, camera, low, high):
    """The image between corners `low`, `high` (2,), pixels of the ideal camera.

    Returns:
        the part (h, w, 3), its corner (2,) and its size (2,), pixels of the ideal camera.
    """
    k = camera.calibration
    squeeze = np.array([1.0, k[1, 1] / k[0, 0]])
    centre = k[:2, 2]
    image, _ = undistorted(image, camera, "zero")
    height, width = image.shape[:2]
    first = np.clip(np.floor(low * squeeze + centre), 0, [width - 8, height - 8]).astype(int)
    last = np.clip(np.ceil(high * squeeze + centre), first + 8, [width, height]).astype(int)
    part = image[first[1] : last[1], first[0] : last[0]]
    return part, (first - centre) / squeeze, (last - first) / squeeze
