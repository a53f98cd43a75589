"""A USD stage, and what stands in it beside the mesh: camera, plate, material."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from vermilion.export.animation import Animation
from vermilion.geometry.camera import Camera
from vermilion.storage.files import atomic_path

ROOT_PATH = "/Face"
CAMERA_PATH, PLATE_PATH = "/Face/camera", "/Face/camera/plate"
MATERIAL_PATH, PLATE_MATERIAL_PATH = "/Face/materials/skin", "/Face/materials/plate"
#: Width of the camera's film: images have none, so that of the 35 mm format.
FILM_MM = 36.0
#: The plate stands behind the head by this share of its distance.
_BEHIND = 1.3
_SKIN = (0.42, 0.31, 0.26)


@contextmanager
def new_stage(path: str | Path, animation: Animation) -> Iterator[Any]:
    """Yield a stage with its unit, up axis, rate, span and `/Face`; it is saved on success.

    Where the world's y points down, `/Face` is turned by half a turn about x.
    """
    with atomic_path(path) as temporary:
        temporary.unlink()  # USD refuses to create a layer over an existing file
        stage = Usd.Stage.CreateNew(str(temporary))
        UsdGeom.SetStageMetersPerUnit(stage, animation.unit_mm / 1000.0)
        upwards = UsdGeom.Tokens.z if animation.up == "z" else UsdGeom.Tokens.y
        UsdGeom.SetStageUpAxis(stage, upwards)
        stage.SetFramesPerSecond(animation.fps)
        stage.SetTimeCodesPerSecond(animation.fps)
        stage.SetStartTimeCode(float(animation.frames[0]))
        stage.SetEndTimeCode(float(animation.frames[-1]))
        root = UsdGeom.Xform.Define(stage, ROOT_PATH)
        stage.SetDefaultPrim(root.GetPrim())
        if animation.turned_upright:
            root.AddRotateXOp().Set(180.0)
        yield stage
        stage.GetRootLayer().Save()
        del stage


def set_topology(mesh: Any, animation: Animation) -> None:
    """Polygons and texture coordinates of a `UsdGeom.Mesh`."""
    polygons = animation.polygons
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateFaceVertexCountsAttr(int_array(polygons.counts))
    mesh.CreateFaceVertexIndicesAttr(int_array(polygons.corners))
    if animation.uv is not None:
        seams = animation.uv_corners
        spread = UsdGeom.Tokens.vertex if seams is None else UsdGeom.Tokens.faceVarying
        primvars = UsdGeom.PrimvarsAPI(mesh)
        st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, spread)
        st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(animation.uv, dtype=np.float32)))
        if seams is not None:
            st.SetIndices(int_array(seams))


def int_array(values: np.ndarray) -> Any:
    """USD's array of integers of `values` (N,)."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, dtype=np.int32))


def vec3_array(values: np.ndarray) -> Any:
    """USD's array of vectors of `values` (N, 3)."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32))


def add_camera(stage: Any, camera: Camera, unit_mm: float) -> None:
    """The camera without its lens distortion; USD looks along -z with y up.

    Apertures and focal length are in tenths of a stage unit, so that the film is 36 mm wide
    whatever the stage's unit.
    """
    k = camera.calibration
    prim = UsdGeom.Camera.Define(stage, CAMERA_PATH)
    per_px = FILM_MM * 10.0 / unit_mm / camera.width_px
    squeeze = k[0, 0] / k[1, 1]
    prim.CreateHorizontalApertureAttr(camera.width_px * per_px)
    prim.CreateVerticalApertureAttr(camera.height_px * per_px * squeeze)
    prim.CreateFocalLengthAttr(k[0, 0] * per_px)
    prim.CreateHorizontalApertureOffsetAttr(-(k[0, 2] - camera.width_px / 2) * per_px)
    prim.CreateVerticalApertureOffsetAttr((k[1, 2] - camera.height_px / 2) * per_px * squeeze)
    prim.CreateClippingRangeAttr(Gf.Vec2f(1.0 / unit_mm, 100000.0 / unit_mm))
    world_from_cam = np.eye(4)
    world_from_cam[:3, :3] = camera.rotation.T @ np.diag([1.0, -1.0, -1.0])
    world_from_cam[:3, 3] = camera.centre_mm / unit_mm
    prim.AddTransformOp().Set(Gf.Matrix4d(world_from_cam.T.tolist()))


def add_plate(stage: Any, animation: Animation) -> None:
    """A card behind the head that fills the camera's view, with the frame's image on it.

    USD has no schema for image planes; programs show the card as it is. The camera also names the
    images in the attribute `plate`.
    """
    camera, plate = animation.camera, animation.plate
    assert camera is not None and plate is not None
    head_mm = np.median(animation.head.translation_mm, axis=0)
    depth = _BEHIND * float(camera.to_camera(head_mm)[2]) / animation.unit_mm
    k = camera.calibration
    edges = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [camera.width_px, camera.height_px]
    x, y = ((edges - [k[0, 2], k[1, 2]]) / [k[0, 0], k[1, 1]]).T * depth
    corners = np.stack([x, -y, np.full(4, -depth)], axis=1)[::-1]
    mesh = UsdGeom.Mesh.Define(stage, PLATE_PATH)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateFaceVertexCountsAttr(int_array(np.array([4])))
    mesh.CreateFaceVertexIndicesAttr(int_array(np.arange(4)))
    mesh.CreatePointsAttr(vec3_array(corners))
    mesh.CreateExtentAttr(vec3_array(np.stack([corners.min(axis=0), corners.max(axis=0)])))
    primvars = UsdGeom.PrimvarsAPI(mesh)
    st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)[::-1]
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv)))
    files: dict[Any, str] = {
        float(frame): plate.format(frame=int(frame)) for frame in animation.frames
    }
    # Programs that read no animated textures show the first image.
    files[Usd.TimeCode.Default()] = plate.format(frame=int(animation.frames[0]))
    material = _textured(stage, PLATE_MATERIAL_PATH, files, emits=True)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    prim = stage.GetPrimAtPath(CAMERA_PATH)
    images = prim.CreateAttribute("plate", Sdf.ValueTypeNames.Asset, True)
    for frame, file in files.items():
        images.Set(Sdf.AssetPath(file), frame)


def bind_skin(stage: Any, mesh: Any, albedo: str | None) -> None:
    """The material of a `UsdGeom.Mesh`: the texture `albedo`, or one colour."""
    if albedo is not None:
        material = _textured(stage, MATERIAL_PATH, {Usd.TimeCode.Default(): albedo}, emits=False)
    else:
        material, shader = _material(stage, MATERIAL_PATH)
        colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        colour.Set(Gf.Vec3f(*_SKIN))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _material(stage: Any, path: str) -> tuple[Any, Any]:
    """A material and its preview surface."""
    UsdGeom.Scope.Define(stage, path.rsplit("/", 1)[0])
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.5)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material, shader


def _textured(stage: Any, path: str, files: dict, emits: bool) -> Any:
    """A material with a texture: time -> file."""
    material, shader = _material(stage, path)
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    place = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture = UsdShade.Shader.Define(stage, f"{path}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(place)
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    file = texture.CreateInput("file", Sdf.ValueTypeNames.Asset)
    for time, name in files.items():
        file.Set(Sdf.AssetPath(name), time)
    colour = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    target = "emissiveColor" if emits else "diffuseColor"
    shader.CreateInput(target, Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    if emits:
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.0))
    return material
