"""A mesh sequence and its camera as Alembic; needs the optional package `alembic3d`."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.export.animation import Animation
from vermilion.export.usd_scene import FILM_MM
from vermilion.geometry.camera import Camera
from vermilion.geometry.vertex_normals import VertexNormals
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path
from vermilion.storage.progress import progress


def alembic_is_installed() -> bool:
    """Whether the optional package is there."""
    return importlib.util.find_spec("alembic3d") is not None


def require_alembic(path: str | Path) -> None:
    """Raise InputError where the optional package is not there; `path` is the file asked for."""
    if not alembic_is_installed():
        raise InputError(
            "no package alembic3d in this environment",
            "it, for Alembic files",
            "Install it with `pip install 'vermilion[alembic]'`, or choose another format.",
            path=path,
        )


def write_alembic(path: str | Path, animation: Animation) -> None:
    """Write `/Face/corrected` and `/Face/camera`, a sample a frame, at the animation's rate.

    The frame `n` is at `n / fps` seconds. Alembic knows no unit: lengths are in the animation's.
    Polygons are wound clockwise, as Alembic has them. A frame without a mesh repeats the one before.

    Raises InputError where the package alembic3d is missing.
    """
    require_alembic(path)
    from alembic3d import Abc, AbcCoreAbstract, AbcGeom

    frames, unit = animation.frames, animation.unit_mm
    if not animation.rows:
        raise InputError("no frame with a mesh", "one at least", "Look at quality.tsv.", path=path)
    with atomic_path(path) as temporary:
        archive = Abc.OArchive(str(temporary))
        step, start = 1.0 / animation.fps, float(frames[0]) / animation.fps
        index = archive.addTimeSampling(AbcCoreAbstract.TimeSampling(step, start))
        face = AbcGeom.OXform(archive.getTop(), "Face")
        pose = AbcGeom.XformSample()
        if animation.turned_upright:
            pose.setXRotation(180.0)
        face.getSchema().set(pose)
        mesh = AbcGeom.OPolyMesh(face, "corrected")
        schema = mesh.getSchema()
        schema.setTimeSampling(index)
        _write_samples(schema, animation)
        if animation.camera is not None:
            _add_camera(face, animation.camera, unit)
        del schema, mesh, face, archive


def _write_samples(schema: Any, animation: Animation) -> None:
    import imath
    from alembic3d import AbcGeom

    polygons = animation.polygons
    facing = VertexNormals(polygons.triangles, len(animation.neutral_mm))
    starts = np.cumsum(polygons.counts) - polygons.counts
    owner = np.repeat(np.arange(len(polygons)), polygons.counts)
    # The last corner of a polygon comes first.
    place = (starts + polygons.counts - 1)[owner] - (np.arange(len(owner)) - starts[owner])
    counts = imath.IntArrayFromBuffer(np.ascontiguousarray(polygons.counts, dtype=np.int32))
    corners = imath.IntArrayFromBuffer(
        np.ascontiguousarray(polygons.corners[place], dtype=np.int32)
    )
    scope = AbcGeom.GeometryScope.kVertexScope
    uv = AbcGeom.OV2fGeomParamSample()
    if animation.uv is not None:
        table, spread = animation.uv, scope
        if animation.uv_corners is not None:
            table, spread = (
                table[animation.uv_corners[place]],
                AbcGeom.GeometryScope.kFacevaryingScope,
            )
        values = imath.V2fArrayFromBuffer(np.ascontiguousarray(table, dtype=np.float32))
        uv = AbcGeom.OV2fGeomParamSample(values, spread)
    rows = {int(animation.frames[row]): row for row in animation.rows}
    last = animation.rows[0]
    span = range(int(animation.frames[0]), int(animation.frames[-1]) + 1)
    for frame in progress(span, "Alembic"):
        last = rows.get(frame, last)
        vertices = np.asarray(animation.vertices_mm[last], np.float64) / animation.unit_mm
        normals = facing.of(vertices).astype(np.float32)
        points = imath.V3fArrayFromBuffer(np.ascontiguousarray(vertices, dtype=np.float32))
        directions = AbcGeom.ON3fGeomParamSample(imath.V3fArrayFromBuffer(normals), scope)
        schema.set(AbcGeom.OPolyMeshSchemaSample(points, corners, counts, uv, directions))


def _add_camera(face: Any, camera: Camera, unit_mm: float) -> None:
    """A camera of 36 mm film; Alembic's apertures are in centimetres, its focal length in mm."""
    import imath
    from alembic3d import AbcGeom

    k = camera.calibration
    pose = np.eye(4)
    pose[:3, :3] = camera.rotation.T @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = camera.centre_mm / unit_mm
    place = AbcGeom.OXform(face, "camera")
    sample = AbcGeom.XformSample()
    sample.setMatrix(imath.M44d(*(float(value) for value in pose.T.ravel())))
    place.getSchema().set(sample)
    per_px = FILM_MM / camera.width_px
    squeeze = k[0, 0] / k[1, 1]
    lens = AbcGeom.CameraSample()
    lens.setFocalLength(float(k[0, 0] * per_px))
    lens.setHorizontalAperture(FILM_MM / 10.0)
    lens.setVerticalAperture(float(camera.height_px * per_px * squeeze / 10.0))
    lens.setHorizontalFilmOffset(float(-(k[0, 2] - camera.width_px / 2) * per_px / 10.0))
    lens.setVerticalFilmOffset(float((k[1, 2] - camera.height_px / 2) * per_px * squeeze / 10.0))
    # Importers that scale the scene leave clipping planes as they are: these suit mm and metres.
    lens.setNearClippingPlane(0.1)
    lens.setFarClippingPlane(10000.0)
    AbcGeom.OCamera(place, "cameraShape").getSchema().set(lens)
