"""Cameras in a USD file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.capture.camera_files.rig_file import RawCamera, RigFile, Sizes, pose, unreadable


def read_usd_cameras(path: Path, sizes: Sizes) -> RigFile:
    """Read every camera at the stage's start; a film fills its image's width.

    Cameras are named after their prims. Their images' sizes are those of `sizes`; without sizes there
    are no cameras.

    Raises InputError where the file is unreadable, has no camera, or one whose image is unknown.
    """
    from pxr import Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(path))
    except Exception as error:  # pxr raises its own kinds
        raise unreadable(path, "USD", error) from error
    time = Usd.TimeCode(stage.GetStartTimeCode())
    prims = [UsdGeom.Camera(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    cameras = {}
    for prim in prims:
        name = prim.GetPrim().GetName()
        size = next(iter(sizes.values())) if len(sizes) == len(prims) == 1 else sizes.get(name)
        if size is None:
            continue
        film = [attribute.Get(time) for attribute in (
            prim.GetHorizontalApertureAttr(), prim.GetVerticalApertureAttr(),
            prim.GetHorizontalApertureOffsetAttr(), prim.GetVerticalApertureOffsetAttr(),
        )]  # fmt: skip
        focal = prim.GetFocalLengthAttr().Get(time)
        fx, fy = focal / film[0] * size[0], focal / film[1] * size[1]
        cx = size[0] / 2 - film[2] / film[0] * size[0]
        cy = size[1] / 2 + film[3] / film[1] * size[1]
        to_world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time))
        turned = to_world[:3, :3] / np.linalg.norm(to_world[:3, :3], axis=1, keepdims=True)
        rotation = np.diag([1.0, -1.0, -1.0]) @ turned
        params = tuple(float(value) for value in (fx, fy, cx, cy))
        transform = pose(rotation, -rotation @ to_world[3, :3])
        cameras[name] = RawCamera("PINHOLE", params, transform, size)
    if not cameras and sizes:
        found = [prim.GetPrim().GetName() for prim in prims]
        raise unreadable(path, f"cameras named as the images ({', '.join(sizes)})", f"has {found}")
    unit = UsdGeom.GetStageMetersPerUnit(stage) * 1000.0
    return RigFile(cameras, unit, (f"USD, {len(cameras)} cameras, a unit is {unit:g} mm",))
