"""What is understood of the cameras of takes: sentences, and an overlay of their images."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from vermilion.capture.camera_files.read import GivenCameras, convergence, read_given_cameras
from vermilion.config.load import load_configuration, read_keys
from vermilion.config.takes import Take
from vermilion.geometry.camera import Camera
from vermilion.imaging.draw import draw_points, label, resized_to_height, tile, to_display
from vermilion.imaging.frames import list_frames, open_frames, read_or_none
from vermilion.imaging.images import image_size, write_srgb8
from vermilion.imaging.source import folder_of, is_single_file
from vermilion.storage.errors import InputError, VermilionError

_AXES_MM = 100.0
_COLOURS = ((255, 60, 60), (60, 220, 60), (60, 120, 255))
_OTHER = (255, 220, 60)


def sizes_of(source: str | Path) -> dict[str, tuple[int, int]]:
    """Camera -> (width, height) of its first readable image, of a capture folder."""
    found = {}
    for folder in sorted(Path(source).glob("frames/*/")):
        for path in list_frames(folder).values():
            try:
                found[folder.name] = image_size(path)
            except InputError:
                continue
            break
    return found


def described(given: GivenCameras, sizes: dict[str, tuple[int, int]]) -> list[str]:
    """Lines: what was understood, then a camera a line."""
    lines = [f"  {sentence}" for sentence in given.understood]
    target = convergence(given.cameras)
    lines.append(f"  the cameras look at ({', '.join(f'{value:.1f}' for value in target)}) mm")
    for name, camera in given.cameras.items():
        k = camera.calibration
        distance = float(np.linalg.norm(camera.centre_mm - target))
        field = np.degrees(2 * np.arctan(camera.width_px / 2 / k[0, 0]))
        line = (
            f"  {name}: {camera.model}, {camera.width_px}x{camera.height_px}, focal length "
            f"{k[0, 0]:.1f} px ({field:.1f} deg), {distance:.0f} mm from there"
        )
        if name not in sizes:
            line += "; no folder of images has this name"
        elif sizes[name] != (camera.width_px, camera.height_px):
            line += f"; its images are {sizes[name][0]}x{sizes[name][1]}"
        lines.append(line)
    lines += [
        f"  {name}: images without a calibration"
        for name in sorted(set(sizes) - set(given.cameras))
    ]
    return lines


def overlay(given: GivenCameras, take: Take, height_px: int = 480) -> np.ndarray:
    """The first frame of each camera with the axes and the other cameras, (h, w, 3) uint8."""
    source = open_frames(take.source, take.subject, take.take)
    target = convergence(given.cameras)
    tiles = []
    for name, camera in given.cameras.items():
        linear = read_or_none(source, name, take.first)
        if linear is None:
            blank = np.full((camera.height_px, camera.width_px, 3), 40, dtype=np.uint8)
            image, note = blank, f"{name}: cannot be read"
        else:
            image, note = to_display(linear), name
        image = _drawn(image, camera, given.cameras, target)
        tiles.append(label(resized_to_height(image, height_px), note))
    return tile(tiles, min(4, len(tiles)))


def _drawn(
    image: np.ndarray, camera: Camera, cameras: dict[str, Camera], target: np.ndarray
) -> np.ndarray:
    ends = target + _AXES_MM * np.eye(3)
    points = camera.project(np.concatenate([target[None], ends]))
    image = np.ascontiguousarray(image).copy()
    width = max(1, image.shape[0] // 240)
    for end, colour in zip(points[1:], _COLOURS, strict=True):
        if np.isfinite(points[0]).all() and np.isfinite(end).all():
            start, stop = (tuple(int(v) for v in np.rint(p)) for p in (points[0], end))
            cv2.line(image, start, stop, colour, width, cv2.LINE_AA)
    others = [other.centre_mm for other in cameras.values() if other.name != camera.name]
    if others:
        seen = camera.project(np.stack(others))
        image = draw_points(image, seen[camera.in_image(seen)], _OTHER, 3 * width)
    return image


def report(configuration: str | Path, wanted: str | None = None) -> int:
    """Print and draw the cameras of a configuration's takes, or of one; returns the exit status."""
    keys = read_keys(configuration)
    loaded, takes = load_configuration(keys, str(configuration), check_disk=False)
    status = 0
    for take in takes:
        if wanted not in (None, take.name):
            continue
        folder = folder_of(take.source, "cameras")
        if is_single_file(take.source) or not folder.is_dir():
            print(
                f"{take.name}: no cameras/ beside its images; calibrated from a board, or assumed"
            )
            continue
        try:
            sizes = sizes_of(take.source)
            given = read_given_cameras(folder, sizes)
            print("\n".join([f"{take.name}: {folder}", *described(given, sizes)]))
            path = Path(loaded.results) / "cameras" / f"{take.subject}-{take.take}.png"
            write_srgb8(path, overlay(given, take))
            print(f"  overlay: {path}")
        except VermilionError as error:
            print(f"{take.name}: {error}", file=sys.stderr)
            status = 1
    return status
