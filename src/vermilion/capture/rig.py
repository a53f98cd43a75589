"""The cameras of a take: given, calibrated from a board, or assumed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.capture.board import Board, BoardDetector, Corners
from vermilion.capture.calibrate import Calibration, CalibrationSettings, calibrate_rig
from vermilion.capture.camera_files.read import read_given_cameras
from vermilion.capture.manifest import Manifest
from vermilion.geometry.camera import Camera, pinhole
from vermilion.imaging.draw import to_display
from vermilion.imaging.images import read_image
from vermilion.imaging.source import IMAGE_SUFFIXES, Source, folder_of, is_single_file
from vermilion.storage.errors import InputError, describe_problem
from vermilion.storage.progress import progress


@dataclass(frozen=True)
class RigCameras:
    """The cameras of a take and their origin.

    Attributes:
        cameras: name -> camera.
        method: `given`, `charuco`, `checkerboard`, `sheet` (a known focal length) or `assumed`.
        calibration: the calibration from a board, if there was one.
    """

    cameras: dict[str, Camera]
    method: str
    calibration: Calibration | None = None

    def summary(self) -> dict:
        """Contents of `capture/cameras.json`."""
        made = self.calibration
        return {
            "calibrated": self.method != "assumed",
            "method": self.method,
            "reprojection_px": made.reprojection_px if made else None,
            "camera_reprojection_px": made.camera_reprojection_px if made else {},
            "dropped_views": [f"{camera}/{moment}" for camera, moment in made.dropped]
            if made
            else [],
        }


def image_sizes(manifests: Sequence[Manifest]) -> dict[str, tuple[int, int]]:
    """Camera -> (width, height) from a take's manifests.

    Raises InputError where chunks disagree.
    """
    sizes: dict[str, set[tuple[int, int]]] = {}
    for manifest in manifests:
        for name, facts in manifest.cameras.items():
            sizes.setdefault(name, set()).add((facts["width_px"], facts["height_px"]))
    mixed = {name: sorted(found) for name, found in sizes.items() if len(found) > 1}
    if mixed:
        raise InputError(
            f"images of several sizes ({mixed})",
            "one size a camera",
            "Export the take again at one size.",
            subject=manifests[0].subject,
            take=manifests[0].take,
        )
    return {name: next(iter(found)) for name, found in sorted(sizes.items())}


def rig_cameras(
    source: Source,
    sizes: dict[str, tuple[int, int]],
    reference: str,
    board: Board,
    settings: CalibrationSettings | None = None,
    focal: float | None = None,
    **place: Any,
) -> RigCameras:
    """Cameras of a take: read from `cameras/`, else calibrated from `calibration/`, else assumed.

    Args:
        source: capture folder, frame folder, video or image.
        sizes: camera -> (width, height) of its images.
        reference: camera whose frame becomes the world of a calibrated rig.
        board: the calibration board.
        settings: how cameras are calibrated.
        focal: known focal length of a single camera, in lengths of the image's longer side; None: assumed.
        place: subject and take, for error messages.

    Raises:
        InputError: several cameras have neither folder, or the given cameras do not fit the images.
    """
    settings = settings or CalibrationSettings()
    given, calibration = folder_of(source, "cameras"), folder_of(source, "calibration")
    if given.is_dir():
        found = read_given_cameras(given, sizes)
        print(*found.understood, sep="\n")
        cameras = found.cameras
        if is_single_file(source) and len(cameras) == len(sizes) == 1:  # its camera has no name
            name, (camera,) = next(iter(sizes)), cameras.values()
            cameras = {name: replace(camera, name=name)}
        _check_given(cameras, sizes, given, place)
        return RigCameras({name: cameras[name] for name in sizes}, "given")
    if calibration.is_dir():
        seen = detect_boards(calibration, board, sizes, place)
        if reference not in sizes:
            reference = min(sizes)
        made = calibrate_rig(board, seen, sizes, reference, settings, **place)
        return RigCameras(made.cameras, board.kind, made)
    if len(sizes) == 1:
        name, (width, height) = next(iter(sizes.items()))
        # Of the longer side, so that a lens is the same upright and across.
        focal_px = (focal or settings.assumed_focal) * max(width, height)
        made_of = "sheet" if focal else "assumed"
        return RigCameras({name: pinhole(name, focal_px, width, height)}, made_of)
    raise InputError(
        f"{len(sizes)} cameras without a calibration",
        "cameras/ (COLMAP, Metashape, OpenCV, USD, ...) or calibration/<camera>/ (views of a board)",
        "Export the rig, for example as COLMAP text, or add ChArUco or checkerboard images.",
        path=given.parent,
        **place,
    )


def calibration_views(folder: Path, camera: str) -> dict[str, Path]:
    """Moment -> image of the board, in order of name."""
    views = folder / camera
    paths = sorted(views.iterdir()) if views.is_dir() else []
    return {path.stem: path for path in paths if path.suffix.lower() in IMAGE_SUFFIXES}


def detect_boards(
    folder: Path, board: Board, sizes: dict[str, tuple[int, int]], place: dict
) -> dict[str, dict[str, Corners]]:
    """Corners in every calibration image of every camera, camera -> moment -> corners.

    Raises InputError listing all images that do not have their camera's size.
    """
    detector, problems = BoardDetector(board), []
    seen: dict[str, dict[str, Corners]] = {}
    for name, size in sizes.items():
        seen[name] = {}
        for moment, path in progress(calibration_views(folder, name).items(), f"board in {name}"):
            linear = read_image(path, camera=name, **place)
            found = (linear.shape[1], linear.shape[0])
            if found != tuple(size):
                problems.append(
                    describe_problem(
                        f"a calibration image of {found[0]}x{found[1]}",
                        f"{size[0]}x{size[1]}, as the camera's frames",
                        "Calibrate at the size of the frames.",
                        camera=name,
                        path=path,
                    )
                )
                continue
            grey = np.rint(to_display(linear) @ [0.299, 0.587, 0.114]).astype(np.uint8)
            seen[name][moment] = detector.detect(grey)
    if problems:
        raise InputError(
            f"{len(problems)} problem(s):\n  " + "\n  ".join(problems) + "\n",
            "calibration images that fit",
            "Correct all of them, then run again.",
            path=folder,
            **place,
        )
    return seen


def _check_given(
    cameras: dict[str, Camera], sizes: dict[str, tuple[int, int]], folder: Path, place: dict
) -> None:
    problems = []
    for name, (width, height) in sizes.items():
        if name not in cameras:
            problems.append(f"camera {name} is not in the model")
        elif (cameras[name].width_px, cameras[name].height_px) != (width, height):
            given = cameras[name]
            problems.append(
                f"camera {name} is calibrated at {given.width_px}x{given.height_px}, its images "
                f"are {width}x{height}"
            )
    if problems:
        raise InputError(
            "; ".join(problems),
            "a calibration of every camera at the size of its images",
            "Correct cameras/, or export the frames at the calibrated size.",
            path=folder,
            **place,
        )
