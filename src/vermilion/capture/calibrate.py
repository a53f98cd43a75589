"""Calibration of a rig from views of a board: intrinsics, poses, then bundle adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import pycolmap

from vermilion.capture.board import Board
from vermilion.capture.bundle_adjust_board import (
    BoardViews,
    RigEstimate,
    bundle_adjust_board,
    reprojection,
)
from vermilion.geometry.camera import Camera
from vermilion.geometry.rotations import mean_rotation
from vermilion.storage.errors import InputError

#: Views of the board that one camera needs.
MIN_VIEWS = 3


@dataclass(frozen=True)
class CalibrationSettings:
    """How cameras are calibrated.

    Attributes:
        camera_model: COLMAP model, `PINHOLE` or `OPENCV` (two radial, two tangential terms).
        refine_principal_point: whether it is estimated, or stays at the middle of the image.
        max_view_px: views with a larger RMS after the first adjustment are dropped once.
        assumed_focal: focal length of a single camera without calibration, in lengths of the longer side.
    """

    camera_model: str = "OPENCV"
    refine_principal_point: bool = True
    max_view_px: float = 2.0
    assumed_focal: float = 1.2


@dataclass(frozen=True)
class Calibration:
    """A calibrated rig.

    World: the frame of the reference camera, millimetres.

    Attributes:
        cameras: name -> camera.
        reprojection_px: RMS over all corners of all views.
        camera_reprojection_px: the same a camera.
        residuals: camera -> moment -> (seen (n, 2), expected (n, 2)) pixels, for overlays.
        dropped: (camera, moment) of the views in which the board was not found or did not fit.
    """

    cameras: dict[str, Camera]
    reprojection_px: float
    camera_reprojection_px: dict[str, float]
    residuals: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]
    dropped: tuple[tuple[str, str], ...]


def calibrate_rig(
    board: Board,
    seen: BoardViews,
    sizes: dict[str, tuple[int, int]],
    reference: str,
    settings: CalibrationSettings | None = None,
    **place: Any,
) -> Calibration:
    """Calibrate all cameras of a rig.

    Args:
        board: the calibration board.
        seen: camera -> moment -> corners. Views of the same name are of the same moment.
        sizes: camera -> (width, height).
        reference: the camera whose frame becomes the world.
        settings: how cameras are calibrated.
        place: subject and take, for error messages.

    Raises:
        InputError: listing every camera that saw the board too few times or shares no moment with
            the others.
    """
    settings = settings or CalibrationSettings()
    free_centre = settings.refine_principal_point
    seen, dropped = _usable(seen)
    _check_enough(seen, sizes, place)
    corners = board.corners_mm
    cameras, boards = {}, {}
    for name, views in sorted(seen.items()):
        cameras[name], boards[name] = _intrinsics(
            views, corners, sizes[name], settings.camera_model, free_centre
        )
    estimate = _chained_poses(cameras, boards, reference, place)
    estimate = bundle_adjust_board(estimate, reference, seen, corners, free_centre)
    bad = {
        (name, moment)
        for name, views in _residuals(estimate, seen, corners).items()
        for moment, (found, expected) in views.items()
        if _rms(expected - found) > settings.max_view_px
    }
    if bad:
        dropped += sorted(bad)
        seen = {
            name: {m: v for m, v in views.items() if (name, m) not in bad}
            for name, views in seen.items()
        }
        _check_enough(seen, sizes, place)
        moments = {m for views in seen.values() for m in views}
        kept = {m: p for m, p in estimate.rig_from_board.items() if m in moments}
        estimate = RigEstimate(estimate.cameras, estimate.camera_from_rig, kept)
        estimate = bundle_adjust_board(estimate, reference, seen, corners, free_centre)
    return _calibration(estimate, seen, corners, tuple(dropped))


def _usable(seen: BoardViews) -> tuple[BoardViews, list[tuple[str, str]]]:
    dropped = [(c, m) for c, views in seen.items() for m, v in views.items() if len(v.ids) < 6]
    kept = {
        c: {m: v for m, v in sorted(views.items()) if len(v.ids) >= 6} for c, views in seen.items()
    }
    return kept, sorted(dropped)


def _check_enough(seen: BoardViews, sizes: dict[str, tuple[int, int]], place: dict) -> None:
    few = {name: len(seen.get(name, {})) for name in sizes if len(seen.get(name, {})) < MIN_VIEWS}
    if few:
        listing = ", ".join(f"{name} {count}" for name, count in sorted(few.items()))
        raise InputError(
            f"the board in too few views ({listing})",
            f"at least {MIN_VIEWS} views a camera",
            "Add calibration images of these cameras, or check the board's squares, sizes and "
            "dictionary in the configuration.",
            **place,
        )


def _intrinsics(
    views: dict, corners_mm: np.ndarray, size: tuple[int, int], model: str, free_centre: bool
) -> tuple[pycolmap.Camera, dict[str, np.ndarray]]:
    """One camera by Zhang's method: its intrinsics, and moment -> camera_from_board (3, 4)."""
    moments = sorted(views)
    objects = [corners_mm[views[m].ids].astype(np.float32) for m in moments]
    pixels = [(views[m].points_px - 0.5).astype(np.float32) for m in moments]
    flags = cv2.CALIB_FIX_K3
    if model == "PINHOLE":
        flags |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST
    if not free_centre:
        flags |= cv2.CALIB_FIX_PRINCIPAL_POINT
    _, k, distortion, turns, shifts = cv2.calibrateCamera(
        objects, pixels, size, None, None, flags=flags
    )
    params = [k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5]
    if model == "OPENCV":
        params += list(np.asarray(distortion).reshape(-1)[:4])
    camera = pycolmap.Camera(model=model, width=size[0], height=size[1], params=params)
    poses = {
        m: np.concatenate([cv2.Rodrigues(r)[0], np.reshape(t, (3, 1))], axis=1)
        for m, r, t in zip(moments, turns, shifts, strict=True)
    }
    return camera, poses


def _chained_poses(
    cameras: dict[str, pycolmap.Camera],
    boards: dict[str, dict[str, np.ndarray]],
    reference: str,
    place: dict,
) -> RigEstimate:
    """Poses of all cameras in the reference's frame, from moments that two cameras share."""
    poses = {reference: np.eye(3, 4)}
    while len(poses) < len(cameras):
        links = [
            (len(shared), known, name)
            for known in poses
            for name in sorted(set(cameras) - set(poses))
            if (shared := set(boards[known]) & set(boards[name]))
        ]
        if not links:
            lonely = sorted(set(cameras) - set(poses))
            raise InputError(
                f"no moment at which {', '.join(lonely)} and {', '.join(sorted(poses))} both see "
                "the board",
                "views named equally across cameras, at the same moment",
                "Add images of the board where neighbouring cameras see it together.",
                **place,
            )
        _, known, name = max(links, key=lambda link: (link[0], link[1], link[2]))
        moments = sorted(set(boards[known]) & set(boards[name]))
        relative = [_compose(boards[name][m], _inverse(boards[known][m])) for m in moments]
        poses[name] = _compose(_mean_pose(relative), poses[known])
    rig_from_board: dict[str, np.ndarray] = {}
    for name in [reference, *sorted(set(cameras) - {reference})]:
        for moment, pose in boards[name].items():
            rig_from_board.setdefault(moment, _compose(_inverse(poses[name]), pose))
    return RigEstimate(cameras, poses, rig_from_board)


def _mean_pose(poses: Sequence[np.ndarray]) -> np.ndarray:
    """(3, 4): chordal mean of the rotations, median of the translations."""
    rotation = mean_rotation(np.stack([pose[:, :3] for pose in poses]))
    return np.concatenate(
        [rotation, np.median([pose[:, 3] for pose in poses], axis=0)[:, None]], axis=1
    )


def _compose(second: np.ndarray, first: np.ndarray) -> np.ndarray:
    rotation = second[:, :3] @ first[:, :3]
    return np.concatenate([rotation, (second[:, :3] @ first[:, 3] + second[:, 3])[:, None]], axis=1)


def _inverse(pose: np.ndarray) -> np.ndarray:
    rotation = pose[:, :3].T
    return np.concatenate([rotation, (-rotation @ pose[:, 3])[:, None]], axis=1)


def _residuals(
    estimate: RigEstimate, seen: BoardViews, corners: np.ndarray
) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """`Calibration.residuals`."""
    return {
        name: {
            moment: (view.points_px, reprojection(estimate, name, moment, corners[view.ids]))
            for moment, view in views.items()
        }
        for name, views in seen.items()
    }


def _rms(differences: np.ndarray) -> float:
    return float(np.sqrt((np.asarray(differences) ** 2).sum(axis=1).mean()))


def _calibration(
    estimate: RigEstimate,
    seen: BoardViews,
    corners: np.ndarray,
    dropped: tuple[tuple[str, str], ...],
) -> Calibration:
    residuals = _residuals(estimate, seen, corners)
    differences = {
        name: np.concatenate([expected - found for found, expected in views.values()])
        for name, views in residuals.items()
    }
    cameras = {
        name: Camera(
            name,
            camera.model_name,
            tuple(float(p) for p in camera.params),
            camera.width,
            camera.height,
            estimate.camera_from_rig[name],
        )
        for name, camera in sorted(estimate.cameras.items())
    }
    return Calibration(
        cameras,
        _rms(np.concatenate(list(differences.values()))),
        {name: _rms(d) for name, d in differences.items()},
        residuals,
        dropped,
    )
