"""A mesh sequence as blend shapes in USD (UsdSkel), on a skeleton of one joint, the head."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, UsdGeom, UsdSkel, Vt
from scipy.spatial.transform import Rotation

from vermilion.export.animation import Animation
from vermilion.export.shape_basis import ShapeBasis
from vermilion.export.usd_scene import (
    ROOT_PATH,
    add_camera,
    add_plate,
    bind_skin,
    new_stage,
    set_topology,
    vec3_array,
)
from vermilion.geometry.mesh import vertex_normals

SKEL_ROOT_PATH = f"{ROOT_PATH}/head"
MESH_PATH = f"{SKEL_ROOT_PATH}/corrected"
_SKELETON_PATH, _ANIMATION_PATH = f"{SKEL_ROOT_PATH}/skeleton", f"{SKEL_ROOT_PATH}/animation"
_JOINT = "head"
#: A vertex that a shape moves by less is left out of it (mm): below what a file's numbers hold.
_LEAST_MM = 1e-6
#: Shapes after which what was set goes to the file, so that memory does not hold them all.
_FLUSH_SHAPES = 50


def write_usd_shapes(path: str | Path, animation: Animation, basis: ShapeBasis) -> None:
    """Write `/Face/head/corrected`: neutral, blend shapes and weights; the joint carries the pose.

    `basis` is of the animation. Lengths are in the animation's unit.
    """
    unit = animation.unit_mm
    with new_stage(path, animation) as stage:
        UsdSkel.Root.Define(stage, SKEL_ROOT_PATH)
        mesh = UsdGeom.Mesh.Define(stage, MESH_PATH)
        set_topology(mesh, animation)
        bind_skin(stage, mesh, animation.albedo)
        neutral = basis.neutral_mm / unit
        mesh.CreatePointsAttr(vec3_array(neutral))
        mesh.CreateExtentAttr(vec3_array(np.stack([neutral.min(axis=0), neutral.max(axis=0)])))
        normals = vertex_normals(basis.neutral_mm, animation.polygons.triangles)
        mesh.CreateNormalsAttr(vec3_array(normals))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        _add_shapes(stage, binding, basis, unit)
        _add_skeleton(stage, binding, len(neutral))
        _add_motion(stage, animation, basis)
        if animation.camera is not None:
            add_camera(stage, animation.camera, unit)
            if animation.plate is not None:
                add_plate(stage, animation)


def identifiers(names: tuple[str, ...]) -> list[str]:
    """Names that USD takes, one each."""
    taken: set[str] = set()
    result = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if re.match(r"[A-Za-z_]", plain) else f"_{plain}"
        while plain in taken:
            plain += "_"
        taken.add(plain)
        result.append(plain)
    return result


def _add_shapes(stage: Any, binding: Any, basis: ShapeBasis, unit_mm: float) -> None:
    names = identifiers(basis.shapes.names)
    targets = binding.CreateBlendShapeTargetsRel()
    for done, (name, shape) in enumerate(zip(names, basis.shapes.shapes_mm, strict=True), start=1):
        moved = np.flatnonzero(np.abs(shape).max(axis=1) > _LEAST_MM)
        moved = moved if len(moved) else np.array([0])
        prim = UsdSkel.BlendShape.Define(stage, f"{MESH_PATH}/{name}")
        prim.CreateOffsetsAttr(vec3_array(shape[moved] / unit_mm))
        ids = np.ascontiguousarray(moved, dtype=np.int32)
        prim.CreatePointIndicesAttr(Vt.IntArray.FromNumpy(ids))
        targets.AddTarget(prim.GetPath())
        if done % _FLUSH_SHAPES == 0:
            stage.GetRootLayer().Save()
    binding.CreateBlendShapesAttr(Vt.TokenArray(names))


def _add_skeleton(stage: Any, binding: Any, n_vertices: int) -> None:
    skeleton = UsdSkel.Skeleton.Define(stage, _SKELETON_PATH)
    identity = Vt.Matrix4dArray([Gf.Matrix4d(1.0)])
    skeleton.CreateJointsAttr(Vt.TokenArray([_JOINT]))
    skeleton.CreateBindTransformsAttr(identity)
    skeleton.CreateRestTransformsAttr(identity)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(
        [Sdf.Path(_ANIMATION_PATH)]
    )
    binding.CreateSkeletonRel().SetTargets([Sdf.Path(_SKELETON_PATH)])
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray([0] * n_vertices))
    binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray([1.0] * n_vertices))


def _add_motion(stage: Any, animation: Animation, basis: ShapeBasis) -> None:
    motion = UsdSkel.Animation.Define(stage, _ANIMATION_PATH)
    motion.CreateJointsAttr(Vt.TokenArray([_JOINT]))
    motion.CreateBlendShapesAttr(Vt.TokenArray(identifiers(basis.shapes.names)))
    places, turns = motion.CreateTranslationsAttr(), motion.CreateRotationsAttr()
    motion.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1.0)]))
    weights = motion.CreateBlendShapeWeightsAttr()
    quaternions = continuous_quaternions(animation.head.rotation[basis.rows])
    for index, row in enumerate(basis.rows):
        frame = float(animation.frames[row])
        place = animation.head.translation_mm[row] / animation.unit_mm
        places.Set(vec3_array(place[None]), frame)
        x, y, z, w = (float(value) for value in quaternions[index])
        turns.Set(Vt.QuatfArray([Gf.Quatf(w, x, y, z)]), frame)
        row_weights = np.ascontiguousarray(basis.shapes.weights[index], dtype=np.float32)
        weights.Set(Vt.FloatArray.FromNumpy(row_weights), frame)


def continuous_quaternions(rotations: np.ndarray) -> np.ndarray:
    """Quaternions (F, 4), xyzw, of rotations (F, 3, 3), each the nearer of two to the one before."""
    found = Rotation.from_matrix(rotations).as_quat()
    flips = np.cumprod(np.where((found[1:] * found[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    found[1:] *= flips[:, None]
    return found
