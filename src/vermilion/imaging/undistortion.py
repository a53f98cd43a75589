"""Distortion of a lens taken out of an image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.sampling import Border, sample_bilinear


def straight_camera(camera: Camera, square: bool = False) -> Camera:
    """The pinhole camera with the same matrix, size and pose; with square pixels if asked for.

    Square pixels keep the horizontal focal length.
    """
    k = camera.calibration
    high = k[0, 0] if square else k[1, 1]
    params = tuple(float(p) for p in (k[0, 0], high, k[0, 2], k[1, 2]))
    return replace(camera, model="PINHOLE", params=params)


def undistorted(
    image: np.ndarray, camera: Camera, border: Border = "repeat", square: bool = False
) -> tuple[np.ndarray, Camera]:
    """The image of the pinhole camera with the same matrix, size and pose.

    Args:
        image: (h, w) or (h, w, c), uint8 or float32.
        camera: of the image, of any model.
        border: what lies beyond the image.
        square: the pinhole camera has square pixels.

    Returns:
        the image, of the same shape and type, and the pinhole camera; both as given for a pinhole
        (with square pixels, if asked for).
    """
    straight = straight_camera(camera, square)
    if camera.is_pinhole and np.allclose(straight.calibration, camera.calibration):
        return image, camera
    origins, directions = straight.rays(straight.pixel_grid())
    return sample_bilinear(image, camera.project(origins + 1000.0 * directions), border), straight
