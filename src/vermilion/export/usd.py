"""A mesh sequence and its camera as USD, with time samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from vermilion.geometry.camera import Camera
from vermilion.storage.files import atomic_path

MESH_PATH, CAMERA_PATH = "/Face/corrected", "/Face/camera"


def write_usd(
    path: str | Path,
    frames: np.ndarray,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    fps: float,
    camera: Camera | None = None,
    uv: np.ndarray | None = None,
) -> None:
    """Write `/Face/corrected`, one time sample a frame, and `/Face/camera`.

    Stage metadata: millimetres (`metersPerUnit` 0.001), y up, time codes are frame numbers. Points
    are those of the sequence. Where the camera's up points down in the world (the world of an
    uncalibrated video is its camera, y down), `/Face` is turned by half a turn about x.

    Args:
        frames: (F,) increasing frame numbers.
        vertices_mm: (F, V, 3), world.
        triangles: (T, 3); uv: (V, 2) optional, v up.
    """
    with atomic_path(path) as temporary:
        temporary.unlink()  # USD refuses to create a layer over an existing file
        stage = Usd.Stage.CreateNew(str(temporary))
        UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.millimeters)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        stage.SetFramesPerSecond(fps)
        stage.SetTimeCodesPerSecond(fps)
        stage.SetStartTimeCode(float(frames[0]))
        stage.SetEndTimeCode(float(frames[-1]))
        root = UsdGeom.Xform.Define(stage, "/Face")
        stage.SetDefaultPrim(root.GetPrim())
        if camera is not None and -camera.rotation[1, 1] < 0:
            root.AddRotateXOp().Set(180.0)
        _add_mesh(stage, frames, vertices_mm, triangles, uv)
        if camera is not None:
            _add_camera(stage, camera)
        stage.GetRootLayer().Save()
        del stage


def _add_mesh(stage, frames, vertices_mm, triangles, uv) -> None:
    mesh = UsdGeom.Mesh.Define(stage, MESH_PATH)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
    ids = np.ascontiguousarray(triangles, dtype=np.int32).ravel()
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(ids))
    if uv is not None:
        values = Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv, dtype=np.float32))
        primvars = UsdGeom.PrimvarsAPI(mesh)
        st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
        st.Set(values)
    points, extent = mesh.CreatePointsAttr(), mesh.CreateExtentAttr()
    for frame, vertices in zip(frames, vertices_mm, strict=True):
        vertices = np.ascontiguousarray(vertices, dtype=np.float32)
        points.Set(Vt.Vec3fArray.FromNumpy(vertices), float(frame))
        bounds = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
        extent.Set(Vt.Vec3fArray.FromNumpy(bounds), float(frame))


def _add_camera(stage, camera: Camera) -> None:
    """The camera without its lens distortion; USD looks along -z with y up."""
    k = camera.calibration
    prim = UsdGeom.Camera.Define(stage, CAMERA_PATH)
    # Apertures and focal length are in tenths of a stage unit; only their ratios matter.
    aperture = 36.0
    per_px = aperture / camera.width_px
    prim.CreateHorizontalApertureAttr(aperture)
    prim.CreateVerticalApertureAttr(camera.height_px * per_px * k[0, 0] / k[1, 1])
    prim.CreateFocalLengthAttr(k[0, 0] * per_px)
    prim.CreateHorizontalApertureOffsetAttr(-(k[0, 2] - camera.width_px / 2) * per_px)
    prim.CreateVerticalApertureOffsetAttr(
        (k[1, 2] - camera.height_px / 2) * per_px * k[0, 0] / k[1, 1]
    )
    prim.CreateClippingRangeAttr(Gf.Vec2f(1.0, 10000.0))
    world_from_cam = np.eye(4)
    world_from_cam[:3, :3] = camera.rotation.T @ np.diag([1.0, -1.0, -1.0])
    world_from_cam[:3, 3] = camera.centre_mm
    prim.AddTransformOp().Set(Gf.Matrix4d(world_from_cam.T.tolist()))
