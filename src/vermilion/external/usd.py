"""Mesh sequences in USD: point caches, transforms, blend shapes and joints (UsdSkel)."""

from __future__ import annotations

from typing import Any

import numpy as np

from vermilion.external.sequence import RawSequence, Request, filled
from vermilion.geometry.polygons import Polygons


def read_usd(request: Request) -> RawSequence:
    """Read the mesh that the request names, or the only one that moves.

    Time codes are frames. Transforms, blend shapes and joints are evaluated.

    Raises InputError where the file is unreadable, or has no such mesh or several.
    """
    from pxr import Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(request.path))
    except Exception as error:  # pxr raises its own kinds
        raise request.error(
            f"an unreadable USD file ({error})", "USD", "Export it again."
        ) from error
    mesh = _chosen(stage, request)
    evaluate, times = _points_of(mesh)
    times = times | _transform_times(mesh)
    if times:
        span = (int(np.floor(min(times))), int(np.ceil(max(times))))
        given = {int(time) for time in times if float(time).is_integer()}
    else:
        span, given = None, set()
    # Between its first and last sample a point cache that skips a frame has lost it; joints and
    # weights may have a key now and then, and programs interpolate.
    keyed = _is_sparse(given, span)
    present = range(span[0], span[1] + 1) if span and keyed else (given or request.frames)
    lost = request.absent(present)
    meshes = {}
    for frame in request.frames:
        if frame in lost:
            continue
        points = evaluate(Usd.TimeCode(frame))
        if points is None:
            lost[frame] = "no points at this time"
            continue
        pose = np.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(Usd.TimeCode(frame)))
        meshes[frame] = points @ pose[:3, :3] + pose[3, :3]
    if not meshes:
        raise request.error("a mesh without points", "points", "Export it again.")
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(), dtype=np.int32)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(), dtype=np.int32)
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        polygons = reversed_polygons(Polygons(counts, corners))
    else:
        polygons = Polygons(counts, corners)
    return RawSequence(
        np.array(request.frames), filled(request.frames, meshes), polygons,
        unit_mm=UsdGeom.GetStageMetersPerUnit(stage) * 1000.0,
        up=str(UsdGeom.GetStageUpAxis(stage)).lower(), lost=lost,
        facts=(f"mesh {mesh.GetPath()}, time codes {span[0]} to {span[1]}" if span else
               f"mesh {mesh.GetPath()}, which does not move",),
    )  # fmt: skip


def reversed_polygons(polygons: Polygons) -> Polygons:
    """The same polygons, wound the other way."""
    starts = np.cumsum(polygons.counts) - polygons.counts
    owner = np.repeat(np.arange(len(polygons)), polygons.counts)
    place = (starts + polygons.counts - 1)[owner] - (np.arange(len(owner)) - starts[owner])
    return Polygons(polygons.counts, polygons.corners[place])


def _is_sparse(given: set[int], span: tuple[int, int] | None) -> bool:
    """Whether samples are so few that they are keys, not frames."""
    return span is not None and len(given) < 0.5 * (span[1] - span[0] + 1)


def _chosen(stage: Any, request: Request) -> Any:
    from pxr import Usd, UsdGeom

    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    meshes = [UsdGeom.Mesh(prim) for prim in everything if prim.IsA(UsdGeom.Mesh)]
    names = [str(mesh.GetPath()) for mesh in meshes]
    if request.mesh is not None:
        found = [mesh for mesh in meshes if str(mesh.GetPath()).endswith(request.mesh)]
        if len(found) != 1:
            raise request.error(
                f"{len(found)} meshes called '{request.mesh}' of {names}",
                "one",
                "Correct `tracking.external.mesh`.",
            )
        return found[0]
    moving = meshes if len(meshes) == 1 else [mesh for mesh in meshes if _moves(mesh)]
    if len(moving) != 1:
        listed = names if not moving else [str(mesh.GetPath()) for mesh in moving]
        raise request.error(
            f"{len(listed)} meshes ({', '.join(listed)})",
            "one mesh, the face",
            "Name it in `tracking.external.mesh`.",
        )
    return moving[0]


def _moves(mesh: Any) -> bool:
    return bool(_points_of(mesh)[1])


def _transform_times(mesh: Any) -> set[float]:
    from pxr import UsdGeom

    times: set[float] = set()
    prim = mesh.GetPrim()
    while prim and not prim.IsPseudoRoot():
        times |= (
            set(UsdGeom.Xformable(prim).GetTimeSamples()) if prim.IsA(UsdGeom.Xformable) else set()
        )
        prim = prim.GetParent()
    return times


def _points_of(mesh: Any) -> tuple[Any, set[float]]:
    """Time code -> points (V, 3) in the mesh's frame, or None; times of its samples."""
    from pxr import Usd, UsdSkel

    def cached(time: Any) -> np.ndarray | None:
        points = mesh.GetPointsAttr().Get(time)
        return None if points is None else np.array(points, dtype=np.float64)

    times = set(mesh.GetPointsAttr().GetTimeSamples())
    root = UsdSkel.Root.Find(mesh.GetPrim())
    if not root:
        return cached, times
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.TraverseInstanceProxies())
    skinned = cache.GetSkinningQuery(mesh.GetPrim())
    skeleton = UsdSkel.BindingAPI(mesh.GetPrim()).GetInheritedSkeleton()
    if not skinned or not skeleton:
        return cached, times
    query = cache.GetSkelQuery(skeleton)
    motion = query.GetAnimQuery()
    if motion:
        prim = motion.GetPrim()
        times |= {t for attribute in prim.GetAttributes() for t in attribute.GetTimeSamples()}

    def evaluated(time: Any) -> np.ndarray | None:
        return _deformed(mesh, skinned, query, motion, cached(time), time)

    return evaluated, times


def _deformed(
    mesh: Any, skinned: Any, query: Any, motion: Any, points: np.ndarray | None, time: Any
) -> np.ndarray | None:
    """Points (V, 3) with blend shapes and joints at `time`."""
    from pxr import UsdGeom

    if points is None:
        return None
    points = points.copy()
    if motion and skinned.HasBlendShapes():
        weights = motion.ComputeBlendShapeWeights(time)
        mapper = skinned.GetBlendShapeMapper()
        _add_shapes(mesh, np.array(mapper.Remap(weights) if mapper else weights), points)
    if skinned.HasJointInfluences():
        transforms = query.ComputeSkinningTransforms(time)
        mapper = skinned.GetJointMapper()
        transforms = mapper.RemapTransforms(transforms) if mapper else transforms
        indices, weights = skinned.ComputeVaryingJointInfluences(len(points), time)
        matrices = np.array(transforms, dtype=np.float64)[
            np.array(indices).reshape(len(points), -1)
        ]
        shares = np.array(weights, dtype=np.float64).reshape(len(points), -1)
        bind = np.array(skinned.GetGeomBindTransform(time))
        whole = np.einsum("vk,vkij->vij", shares, matrices)
        homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ bind
        points = np.einsum("vi,vij->vj", homogeneous, whole)[:, :3]
        # The skeleton's frame, in which joints are, as seen from the mesh.
        cache = UsdGeom.XformCache(time)
        to_world = np.array(cache.GetLocalToWorldTransform(query.GetPrim()))
        back = to_world @ np.linalg.inv(np.array(cache.GetLocalToWorldTransform(mesh.GetPrim())))
        points = points @ back[:3, :3] + back[3, :3]
    return points


def _add_shapes(mesh: Any, weights: np.ndarray, points: np.ndarray) -> None:
    """Add the blend shapes of a mesh, weights (K,), to points (V, 3) in place."""
    from pxr import UsdSkel, Vt

    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(mesh.GetPrim()))
    values = Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights, dtype=np.float32))
    shares, owners, parts = shapes.ComputeSubShapeWeights(values)
    indices, offsets = shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets()
    for share, owner, part in zip(shares, owners, parts, strict=True):
        at = np.array(indices[owner], dtype=int)
        moves = np.array(offsets[part], dtype=np.float64)
        points[at if len(at) else slice(None)] += share * moves
