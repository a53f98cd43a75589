"""The images of one frame as the stage uses them: undistorted, grey, locally normalised."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.frames import FrameSource
from vermilion.imaging.images import LUMINANCE, linear_to_srgb
from vermilion.imaging.undistortion import undistorted
from vermilion.storage.errors import InputError

#: Grey levels of one local deviation in a normalised image.
DEVIATION = 40


@dataclass(frozen=True)
class View:
    """One camera's image of one frame.

    Attributes:
        camera: a pinhole camera; distortion has been taken out of the image.
        grey: (h, w) float32 sRGB luma in [0, 1].
        normalised: (h, w) uint8, local mean 128 and local deviation 40 where there is texture.
    """

    camera: Camera
    grey: np.ndarray
    normalised: np.ndarray


@dataclass(frozen=True)
class Frame:
    """All views of one frame, and what could not be read.

    Attributes:
        number: frame number.
        views: camera name -> View, sorted by name.
        missing: camera name -> reason.
    """

    number: int
    views: dict[str, View]
    missing: dict[str, str]


def make_view(
    camera: Camera, linear_rgb: np.ndarray, window_px: float, floor: float, scale: float = 1.0
) -> View:
    """Undistort, take the luma, normalise locally.

    Args:
        camera: of the image; any COLMAP model.
        linear_rgb: (h, w, 3) float32.
        window_px: standard deviation of the Gaussian window of the local mean and deviation.
        floor: deviation (of luma in [0, 1]) that is added so that flat areas stay flat.
        scale: size of the view against the image; `window_px` is of the view.
    """
    grey, camera = undistorted(linear_to_srgb(linear_rgb @ LUMINANCE), camera)
    view = View(camera, grey, normalise(grey, window_px, floor) if scale == 1.0 else grey)
    return view if scale == 1.0 else _shrunk(view, scale, window_px, floor)


def shrunk(frame: Frame, scale: float, window_px: float, floor: float) -> Frame:
    """The frame with all images resized by `scale` below one; `window_px` of the small ones."""
    views = {name: _shrunk(v, scale, window_px, floor) for name, v in frame.views.items()}
    return Frame(frame.number, views, frame.missing)


def _shrunk(view: View, scale: float, window_px: float, floor: float) -> View:
    camera = view.camera.resized(scale)
    size = (camera.width_px, camera.height_px)
    grey = cv2.resize(view.grey, size, interpolation=cv2.INTER_AREA)
    return View(camera, grey, normalise(grey, window_px, floor))


def normalise(grey: np.ndarray, window_px: float, floor: float) -> np.ndarray:
    """Local contrast normalisation of grey (h, w) in [0, 1] to (h, w) uint8 round 128.

    Two box filters have the spread of a Gaussian of `window_px`, at a cost that does not grow.
    """
    width = 2 * round((np.sqrt(6 * window_px**2 + 1) - 1) / 2) + 1
    mean, square = (
        cv2.blur(cv2.blur(values, (width, width)), (width, width)) for values in (grey, grey * grey)
    )
    deviation = np.sqrt(np.maximum(square - mean * mean, 0)) + floor
    return np.clip(128 + DEVIATION * (grey - mean) / deviation, 0, 255).astype(np.uint8)


def load_frame(
    source: FrameSource,
    cameras: Mapping[str, Camera],
    number: int,
    window_px: float,
    floor: float,
    scale: float = 1.0,
) -> Frame:
    """Read every camera of a frame; a camera without a readable image is noted as missing.

    Raises InputError where fewer than two cameras are left.
    """
    views, missing = {}, {}
    for name, camera in sorted(cameras.items()):
        try:
            linear = source.read(name, number)
        except InputError as error:
            missing[name] = str(error)
            continue
        if linear.shape[:2] != (camera.height_px, camera.width_px):
            missing[name] = (
                f"image of {linear.shape[1]} x {linear.shape[0]}, "
                f"camera of {camera.width_px} x {camera.height_px}"
            )
            continue
        views[name] = make_view(camera, linear, window_px, floor, scale)
    if len(views) < 2:
        reasons = "; ".join(list(missing.values())[:2])
        if len(missing) > 2:
            reasons += f"; and {len(missing) - 2} more"
        raise InputError(
            f"{len(views)} readable images ({reasons})",
            "two or more cameras",
            "Export the frame again or take it out of the take sheet.",
            frame=number,
        )
    return Frame(number, views, missing)
