"""A mesh sequence and its camera as USD: one time sample a frame (a point cache)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import UsdGeom

from vermilion.export.animation import Animation
from vermilion.export.usd_scene import (
    CAMERA_PATH,
    ROOT_PATH,
    add_camera,
    add_plate,
    bind_skin,
    new_stage,
    set_topology,
    vec3_array,
)
from vermilion.geometry.vertex_normals import VertexNormals
from vermilion.storage.progress import progress

__all__ = ["CAMERA_PATH", "MESH_PATH", "write_usd"]

MESH_PATH = f"{ROOT_PATH}/corrected"
#: Frames after which what was set goes to the file, so that memory does not hold the take.
_FLUSH_FRAMES = 100


def write_usd(path: str | Path, animation: Animation) -> None:
    """Write `/Face/corrected` (points and normals a frame) and `/Face/camera` with the plate.

    Time codes are frame numbers, y is up, lengths are in the animation's unit. Points are those of
    the sequence; a frame without a mesh has no sample.
    """
    facing = VertexNormals(animation.polygons.triangles, len(animation.neutral_mm))
    with new_stage(path, animation) as stage:
        mesh = UsdGeom.Mesh.Define(stage, MESH_PATH)
        set_topology(mesh, animation)
        bind_skin(stage, mesh, animation.albedo)
        if animation.camera is not None:
            add_camera(stage, animation.camera, animation.unit_mm)
            if animation.plate is not None:
                add_plate(stage, animation)
        points, extent = mesh.CreatePointsAttr(), mesh.CreateExtentAttr()
        normals = mesh.CreateNormalsAttr()
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        for done, row in enumerate(progress(animation.rows, "USD"), start=1):
            frame = float(animation.frames[row])
            vertices = np.asarray(animation.vertices_mm[row], np.float64) / animation.unit_mm
            points.Set(vec3_array(vertices), frame)
            normals.Set(vec3_array(facing.of(vertices)), frame)
            extent.Set(vec3_array(np.stack([vertices.min(axis=0), vertices.max(axis=0)])), frame)
            if done % _FLUSH_FRAMES == 0:
                stage.GetRootLayer().Save()
