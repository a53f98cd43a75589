"""Distortion of a lens taken out of an image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.sampling import Border, sample_bilinear


def undistorted(
    image: np.ndarray, camera: Camera, border: Border = "repeat"
) -> tuple[np.ndarray, Camera]:
    """The image of the pinhole camera with the same matrix, size and pose.

    Args:
        image: (h, w) or (h, w, c), uint8 or float32.
        camera: of the image, of any model.
        border: what lies beyond the image.

    Returns:
        the image, of the same shape and type, and the pinhole camera; both as given for a pinhole.
    """
    if camera.is_pinhole:
        return image, camera
    k = camera.calibration
    params = tuple(float(p) for p in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))
    straight = replace(camera, model="PINHOLE", params=params)
    origins, directions = straight.rays(straight.pixel_grid())
    return sample_bilinear(image, camera.project(origins + 1000.0 * directions), border), straight
