"""Mesh sequences in Alembic; needs the optional package `alembic3d`."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np

from vermilion.external.sequence import RawSequence, Request, filled
from vermilion.external.usd import reversed_polygons
from vermilion.geometry.polygons import Polygons


def read_alembic(request: Request) -> RawSequence:
    """Read the mesh that the request names, or the only one that moves, with its transforms.

    Frames are times multiplied by the request's rate, or by that of the file's samples. Alembic
    winds polygons clockwise; here they come counter-clockwise.

    Raises InputError where the package alembic3d is missing, the file is unreadable, or has no such mesh.
    """
    if importlib.util.find_spec("alembic3d") is None:
        raise request.error(
            "no package alembic3d in this environment",
            "it, for Alembic files",
            "Install it with `pip install 'vermilion[alembic]'`, or export as USD.",
        )
    from alembic3d import Abc, AbcGeom

    try:
        archive = Abc.IArchive(str(request.path))
        found = list(_meshes(archive.getTop(), [], AbcGeom))
    except Exception as error:  # the bindings raise RuntimeError and their own
        raise request.error(
            f"an unreadable Alembic file ({error})", "Ogawa Alembic", "Export it again."
        ) from error
    name, chain, schema = _chosen(found, request)
    times = _times(schema)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    fps = request.fps or (1.0 / step if step else 25.0)
    keys = [round(time * fps) for time in times]
    lost = request.absent(keys)
    meshes, polygons = {}, None
    for frame in request.frames:
        if frame in lost:
            continue
        time = times[keys.index(frame)]
        sample = schema.getValue(Abc.ISampleSelector(time))
        points = np.array(memoryview(sample.getPositions()), dtype=np.float64)
        if polygons is None:
            polygons = _polygons(sample)
        for link in chain:
            matrix = _matrix(link, time, Abc)
            points = points @ matrix[:3, :3] + matrix[3, :3]
        meshes[frame] = points
    assert polygons is not None
    return RawSequence(
        np.array(request.frames), filled(request.frames, meshes), polygons, lost=lost,
        facts=(f"mesh {name}, {len(times)} samples, {fps:g} a second",),
    )  # fmt: skip


def _meshes(parent: Any, chain: list, kinds: Any) -> Any:
    """(path, schemas of the transforms above from near to far, schema) of every mesh."""
    for index in range(parent.getNumChildren()):
        child = parent.getChild(index)
        header = child.getHeader()
        if kinds.IPolyMesh.matches(header):
            mesh = kinds.IPolyMesh(parent, header.getName())
            yield child.getFullName(), chain, mesh.getSchema()
        below = chain
        if kinds.IXform.matches(header):
            below = [kinds.IXform(parent, header.getName()).getSchema(), *chain]
        yield from _meshes(child, below, kinds)


def _chosen(found: list, request: Request) -> tuple:
    if request.mesh is not None:
        chosen = [entry for entry in found if entry[0].endswith(request.mesh)]
    else:
        moving = [entry for entry in found if entry[2].getNumSamples() > 1]
        chosen = found if len(found) == 1 else moving
    return request.only(chosen, [entry[0] for entry in found])


def _times(schema: Any) -> list[float]:
    sampling = schema.getTimeSampling()
    return [float(sampling.getSampleTime(k)) for k in range(schema.getNumSamples())]


def _polygons(sample: Any) -> Polygons:
    counts = np.array(memoryview(sample.getFaceCounts()), dtype=np.int32)
    corners = np.array(memoryview(sample.getFaceIndices()), dtype=np.int32)
    return reversed_polygons(Polygons(counts, corners))


def _matrix(schema: Any, time: float, abc: Any) -> np.ndarray:
    """(4, 4) of a transform at `time`, rows as vectors."""
    sample = schema.getValue(abc.ISampleSelector(time))
    matrix = sample.getMatrix()
    return np.array([[matrix[i][j] for j in range(4)] for i in range(4)])
