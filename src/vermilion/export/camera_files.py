"""One still camera without lens distortion, for other programs: USD and JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from pxr import Usd, UsdGeom

from vermilion.export.usd_scene import ROOT_PATH, add_camera
from vermilion.geometry.camera import Camera
from vermilion.storage.files import atomic_path


def write_camera_usd(path: str | Path, camera: Camera, fps: float, frames: Sequence[int]) -> None:
    """A USD stage in millimetres with the camera alone, and the span and rate of the frames."""
    with atomic_path(path) as temporary:
        temporary.unlink()  # USD refuses to create a layer over an existing file
        stage = Usd.Stage.CreateNew(str(temporary))
        UsdGeom.SetStageMetersPerUnit(stage, 0.001)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        stage.SetFramesPerSecond(fps)
        stage.SetTimeCodesPerSecond(fps)
        stage.SetStartTimeCode(float(min(frames)))
        stage.SetEndTimeCode(float(max(frames)))
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT_PATH).GetPrim())
        add_camera(stage, camera, 1.0)
        stage.GetRootLayer().Save()
        del stage


def write_camera_json(path: str | Path, camera: Camera, fps: float, frames: Sequence[int]) -> None:
    """The camera in plain numbers.

    Pixels: x right, y down, the centre of the top left pixel is (0.5, 0.5). `cam_from_world` is [R | t], in
    millimetres, camera x right, y down, z forward.
    """
    k = camera.calibration
    content = {
        "name": camera.name,
        "unit": "mm",
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "focal_px": [float(k[0, 0]), float(k[1, 1])],
        "centre_px": [float(k[0, 2]), float(k[1, 2])],
        "cam_from_world": camera.cam_from_world.tolist(),
        "fps": fps,
        "frames": [int(frame) for frame in frames],
    }
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
