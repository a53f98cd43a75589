"""Images of the capture stage: contact sheets, seen and expected corners."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vermilion.capture.calibrate import Calibration
from vermilion.imaging.draw import draw_points, label, resized_to_height, tile, to_display

SEEN, EXPECTED, REFINED = (60, 220, 60), (255, 60, 60), (60, 120, 255)


def contact_sheet(images: Mapping[str, np.ndarray | None]) -> np.ndarray:
    """One image a camera with its name, (h, w, 3) uint8.

    `images` maps a camera to its image (h, w, 3), linear RGB, or to None, which is drawn as missing.
    """
    tiles = []
    for name, linear in images.items():
        if linear is None:
            blank = np.full((320, 320, 3), 40, dtype=np.uint8)
            tiles.append(label(blank, f"{name}: cannot be read"))
            continue
        tiles.append(label(resized_to_height(to_display(linear), 320), name))
    return tile(tiles, min(5, len(tiles)))


def calibration_sheet(
    calibration: Calibration, views: Mapping[str, Mapping[str, np.ndarray]], height_px: int = 480
) -> np.ndarray:
    """The worst view of each camera with seen (green) and expected (red) corners.

    Args:
        calibration: of the rig.
        views: camera -> moment -> image (h, w, 3), linear RGB; only the worst moment is used.
        height_px: of a view.

    Returns:
        (h, w, 3) uint8.
    """
    tiles = []
    for name in calibration.cameras:
        residuals = calibration.residuals[name]
        moment = worst_view(calibration, name)
        seen, expected = residuals[moment]
        image = to_display(views[name][moment])
        scale = height_px / image.shape[0]
        image = resized_to_height(image, height_px)
        image = draw_points(image, seen * scale, SEEN, 3)
        image = draw_points(image, expected * scale, EXPECTED, 1)
        rms = calibration.camera_reprojection_px[name]
        tiles.append(label(image, f"{name} {moment}  {rms:.3f} px"))
    return tile(tiles, min(4, len(tiles)))


def refinement_sheet(
    images: Mapping[str, np.ndarray | None],
    shown: Mapping[str, tuple],
    moved: Mapping[str, Mapping[str, float]],
    height_px: int = 480,
) -> np.ndarray:
    """Held-out points as seen (green) and as expected by the given (red) and refined cameras (blue).

    Args:
        images: camera -> image (h, w, 3), linear RGB, or None.
        shown, moved: of a `RigRefinement`.
        height_px: of an image.

    Returns:
        (h, w, 3) uint8.
    """
    tiles = []
    for name, linear in images.items():
        if linear is None or name not in shown:
            continue
        scale = height_px / linear.shape[0]
        image = resized_to_height(to_display(linear), height_px)
        seen, given, refined = shown[name]
        image = draw_points(image, given * scale, EXPECTED, 2)
        image = draw_points(image, seen * scale, SEEN, 2)
        if refined is not None:
            image = draw_points(image, refined * scale, REFINED, 1)
        text = name
        if name in moved:
            text += f"  {moved[name]['turned_deg']:.2f} deg {moved[name]['moved_mm']:.2f} mm"
        tiles.append(label(image, text))
    return tile(tiles, min(5, len(tiles)))


def worst_view(calibration: Calibration, camera: str) -> str:
    """The moment with the largest reprojection error of a camera."""
    residuals = calibration.residuals[camera]
    return max(residuals, key=lambda m: float(np.abs(residuals[m][0] - residuals[m][1]).max()))
