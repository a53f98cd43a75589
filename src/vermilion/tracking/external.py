"""Coarse mesh sequences of other trackers: a folder of OBJ or PLY files, an `.npz`, or USD.

A take with role `tracked` has such a sequence instead of images.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import MESH_SUFFIXES, read_mesh
from vermilion.imaging.numbering import numbered_files
from vermilion.storage.errors import InputError

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


@dataclass(frozen=True)
class MeshSequence:
    """Meshes of one topology.

    Attributes:
        frames: (F,) int numbers.
        vertices_mm: (F, V, 3) float32, world.
        triangles: (T, 3) int32.
    """

    frames: np.ndarray
    vertices_mm: np.ndarray
    triangles: np.ndarray


def read_tracked(
    source: str | Path, frames: list[int], unit_mm: float | None = None, **place: Any
) -> MeshSequence:
    """Read some frames of a mesh sequence.

    Args:
        source: folder of numbered `.obj` or `.ply`; `.npz` with `vertices_mm` (F, V, 3),
            `triangles` (T, 3) and optionally `frames` (F,), else counted from 0; or a USD file
            with one animated mesh, whose time codes are the frames.
        frames: numbers of the frames to read.
        unit_mm: length of the file's unit, mm; None: USD's own unit, 1 for the others.
        place: subject and take, for error messages.

    Raises:
        InputError: a frame is missing, its topology differs, or the file has none of these forms.
    """
    source = Path(source)
    if source.is_dir():
        sequence = _read_folder(source, frames, place)
    elif source.suffix.lower() == ".npz":
        sequence = _read_npz(source, frames, place)
    elif source.suffix.lower() in USD_SUFFIXES:
        sequence = _read_usd(source, frames, place, own_unit=unit_mm is None)
    else:
        raise InputError(
            "no mesh sequence",
            "a folder of .obj or .ply, an .npz, or a USD file",
            "Correct the `source` of the take sheet.",
            path=source,
            **place,
        )
    vertices = sequence.vertices_mm * np.float32(1.0 if unit_mm is None else unit_mm)
    return MeshSequence(sequence.frames, vertices, sequence.triangles)


def _read_folder(folder: Path, frames: list[int], place: dict) -> MeshSequence:
    paths = numbered_files(folder, MESH_SUFFIXES)
    meshes: list[Mesh] = []
    for frame in frames:
        if frame not in paths:
            raise _missing(frame, paths, folder, place)
        mesh = read_mesh(paths[frame])
        if meshes and not np.array_equal(mesh.triangles, meshes[0].triangles):
            raise InputError(
                f"another topology ({len(mesh.triangles)} triangles) than in frame {frames[0]} "
                f"({len(meshes[0].triangles)} triangles)",
                "one topology a take",
                "Export all frames of one mesh, with vertex order kept.",
                frame=frame,
                path=paths[frame],
                **place,
            )
        meshes.append(mesh)
    vertices = np.array([mesh.vertices_mm for mesh in meshes], dtype=np.float32)
    return MeshSequence(np.array(frames), vertices, meshes[0].triangles)


def _read_npz(path: Path, frames: list[int], place: dict) -> MeshSequence:
    try:
        with np.load(path, allow_pickle=False) as data:
            vertices, triangles = data["vertices_mm"], data["triangles"]
            numbers = data["frames"] if "frames" in data.files else np.arange(len(vertices))
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise InputError(
            f"an unreadable file ({error})",
            "a .npz with vertices_mm (F, V, 3) and triangles (T, 3)",
            "Export it again.",
            path=path,
            **place,
        ) from error
    if vertices.ndim != 3 or vertices.shape[2] != 3 or triangles.shape[1:] != (3,):
        raise InputError(
            f"vertices_mm {vertices.shape} and triangles {triangles.shape}",
            "(F, V, 3) and (T, 3)",
            "Export it again.",
            path=path,
            **place,
        )
    rows = {int(number): row for row, number in enumerate(numbers)}
    for frame in frames:
        if frame not in rows:
            raise _missing(frame, rows, path, place)
    chosen = vertices[[rows[frame] for frame in frames]].astype(np.float32)
    return MeshSequence(np.array(frames), chosen, triangles.astype(np.int32))


def _read_usd(path: Path, frames: list[int], place: dict, own_unit: bool) -> MeshSequence:
    from pxr import Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(path))
    except Exception as error:  # pxr raises its own kinds
        raise InputError(
            f"an unreadable USD file ({error})", "USD", "Export it again.", path=path, **place
        ) from error
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    if len(meshes) != 1:
        raise InputError(
            f"{len(meshes)} meshes",
            "one mesh, the face",
            "Export the face alone.",
            path=path,
            **place,
        )
    mesh = meshes[0]
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get())
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    points = mesh.GetPointsAttr()
    times = [int(t) for t in points.GetTimeSamples()]
    vertices = []
    unit = UsdGeom.GetStageMetersPerUnit(stage) * 1000.0 if own_unit else 1.0
    for frame in frames:
        if times and frame not in times:
            raise _missing(frame, times, path, place)
        to_world = np.array(
            UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(Usd.TimeCode(frame))
        )
        local = np.array(points.Get(Usd.TimeCode(frame)), dtype=np.float64)
        vertices.append((local @ to_world[:3, :3] + to_world[3, :3]) * unit)
    return MeshSequence(
        np.array(frames), np.array(vertices, dtype=np.float32), _fans(counts, corners)
    )


def _fans(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Triangles (T, 3) of convex polygons: corner counts (P,), corners (sum of counts,)."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    triangles = []
    for extra in range(2, counts.max(initial=0)):
        wide = starts[counts > extra]
        triangles.append(
            np.stack([corners[wide], corners[wide + extra - 1], corners[wide + extra]], axis=1)
        )
    return np.concatenate(triangles).astype(np.int32)


def _missing(frame: int, present: Iterable[int], path: Path, place: dict) -> InputError:
    known = sorted(present)
    span = f"frames {known[0]} to {known[-1]}" if known else "no numbered frames"
    return InputError(
        span,
        f"frame {frame}",
        "Correct `first` and `last` of the take sheet, or export the frame.",
        frame=frame,
        path=path,
        **place,
    )
