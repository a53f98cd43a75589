"""Folders of numbered OBJ, PLY or STL files, and `.npz` archives."""

from __future__ import annotations

import numpy as np

from vermilion.external.flame import is_flame, read_flame, read_flame_folder
from vermilion.external.sequence import RawSequence, Request, filled
from vermilion.geometry.mesh_files import MESH_SUFFIXES, read_polygons
from vermilion.geometry.polygons import Polygons
from vermilion.imaging.numbering import numbered_files
from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError


def read_folder(request: Request) -> RawSequence:
    """Read a file a frame, meshes or parameters of FLAME; one that is missing or damaged costs its frame.

    Raises InputError where no frame can be read, or one has another topology than those before.
    """
    parameters = numbered_files(request.path, [".npz"])
    if parameters:
        return read_flame_folder(request, parameters)
    paths = numbered_files(request.path, MESH_SUFFIXES)
    lost = request.absent(paths)
    meshes: dict[int, np.ndarray] = {}
    topology: Polygons | None = None
    problem: InputError | None = None
    for frame in request.frames:
        if frame in lost:
            continue
        try:
            vertices, polygons = read_polygons(paths[frame])
        except InputError as error:
            lost[frame], problem = error.brief, error
            continue
        if topology is None:
            topology = polygons
        elif not _same(topology, polygons) or vertices.shape != next(iter(meshes.values())).shape:
            raise request.error(
                f"another topology ({len(vertices)} vertices, {len(polygons)} polygons) than in "
                f"frame {next(iter(meshes))} ({len(next(iter(meshes.values())))} vertices, "
                f"{len(topology)} polygons)",
                "one topology a take",
                "Export all frames of one mesh, with vertex order kept.",
                frame=frame,
                path=paths[frame],
            )
        meshes[frame] = vertices
    if topology is None:
        assert problem is not None
        raise problem
    kinds = sorted({path.suffix.lower() for path in paths.values()})
    facts = (f"{len(paths)} files {'/'.join(kinds)}, frames {min(paths)} to {max(paths)}",)
    vertices = filled(request.frames, meshes)
    if kinds == [".stl"]:
        vertices, topology = _welded(vertices, topology, next(iter(meshes.values())))
    return RawSequence(np.array(request.frames), vertices, topology, lost=lost, facts=facts)


def _welded(
    vertices: np.ndarray, polygons: Polygons, first: np.ndarray
) -> tuple[np.ndarray, Polygons]:
    """Vertices (F, V, 3) and polygons with the corners joined that coincide in `first` (V, 3).

    All frames are joined as the first, since lips that touch coincide elsewhere.
    """
    _, where, number = np.unique(first, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(where)  # vertices in the order in which the file names them
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    joined = Polygons(polygons.counts, rank[number.reshape(-1)[polygons.corners]])
    return vertices[:, where[order]], joined


def _same(one: Polygons, other: Polygons) -> bool:
    return np.array_equal(one.counts, other.counts) and np.array_equal(one.corners, other.corners)


def _whole(values: np.ndarray) -> bool:
    """Whether all are whole numbers, of whatever type."""
    if values.dtype.kind != "f":
        return values.dtype.kind in "iu"
    return bool(np.isfinite(values).all() and (values == np.rint(values)).all())


def read_archive(request: Request) -> RawSequence:
    """Read `vertices_mm` (or `vertices`) (F, V, 3), `triangles` or `quads`, and `frames` if there; or FLAME's.

    Raises InputError where the arrays are missing or of other shapes.
    """
    data = read_arrays(
        request.path, "mesh sequence", remedy="Export it again: vertices_mm (F, V, 3), triangles (T, 3).",
        **request.place,
    )  # fmt: skip
    if is_flame(data):
        return read_flame(request, data)
    named = "vertices_mm" in data
    vertices = data["vertices_mm" if named else "vertices"]
    faces = data["quads" if "quads" in data else "triangles"]
    numbers = data.get("frames", np.arange(len(vertices) if vertices.ndim else 0))
    shaped = vertices.ndim == 3 and vertices.shape[2] == 3
    if not shaped or faces.ndim != 2 or faces.shape[1] not in (3, 4) or len(faces) == 0:
        raise request.error(
            f"vertices {vertices.shape} and faces {faces.shape}",
            "(F, V, 3) and (T, 3)",
            "Export it again.",
        )
    if vertices.dtype.kind not in "fiu" or not _whole(faces):
        raise request.error(
            f"vertices of type {vertices.dtype} and faces of type {faces.dtype}",
            "numbers, and whole numbers",
            "Export it again.",
        )
    if numbers.shape != (len(vertices),) or not _whole(numbers):
        raise request.error(
            f"frames of shape {numbers.shape} and type {numbers.dtype}",
            f"{len(vertices)} whole numbers, one a mesh",
            "Export it again.",
        )
    if faces.min() < 0 or faces.max() >= vertices.shape[1]:
        raise request.error(
            f"a face with vertex {int(faces.max())} of {vertices.shape[1]}",
            "vertex numbers from 0",
            "Subtract 1 where the faces count from 1, and export again.",
        )
    rows = {int(number): row for row, number in enumerate(numbers)}
    lost = request.absent(rows)
    meshes = {frame: vertices[rows[frame]] for frame in request.frames if frame in rows}
    polygons = Polygons(
        np.full(len(faces), faces.shape[1], np.int32), faces.astype(np.int32).ravel()
    )
    return RawSequence(
        np.array(request.frames), filled(request.frames, meshes), polygons,
        unit_mm=1.0 if named else None, lost=lost,
        facts=(f"{len(rows)} frames, {min(rows)} to {max(rows)}",),
    )  # fmt: skip
