"""Mesh sequences: (frames, vertices, 3) float32 `.npy` beside one topology `.ply`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vermilion.geometry.mesh import Mesh
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path


def write_sequence(path: str | Path, vertices_mm: np.ndarray) -> None:
    """Write (F, V, 3) as float32 `.npy`."""
    if vertices_mm.ndim != 3 or vertices_mm.shape[2] != 3:
        raise ValueError(f"a sequence must be (F, V, 3), got {vertices_mm.shape}")
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        np.save(stream, np.ascontiguousarray(vertices_mm, dtype=np.float32))


def read_sequence(paths: str | Path | Sequence[str | Path]) -> np.ndarray:
    """Read one chunk (memory-mapped) or join several, (F, V, 3) float32, mm."""
    if isinstance(paths, str | Path):
        return _open_sequence(paths)
    return np.concatenate([_open_sequence(path) for path in paths])


def _open_sequence(path: str | Path) -> np.ndarray:
    try:
        vertices = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise InputError(
            f"an unreadable mesh sequence ({error})",
            "a .npy of (frames, vertices, 3)",
            "Remove the file and run again.",
            path=path,
        ) from error
    if vertices.ndim != 3 or vertices.shape[2] != 3:
        raise InputError(
            f"an array of shape {vertices.shape}",
            "(frames, vertices, 3)",
            "Give a mesh sequence.",
            path=path,
        )
    return vertices


def frames_of(paths: Sequence[str | Path]) -> np.ndarray:
    """Frame numbers of chunk files `<first>-<last>.<suffix>` in their order."""
    spans = [[int(number) for number in Path(path).stem.split("-")] for path in paths]
    return np.concatenate([np.arange(first, last + 1) for first, last in spans])


def locate(paths: Sequence[str | Path], frames: Sequence[int]) -> dict[int, tuple[str | Path, int]]:
    """Frame number -> (chunk file `<first>-<last>.<suffix>`, its row there)."""
    wanted = {int(frame) for frame in frames}
    return {
        int(frame): (path, row)
        for path in paths
        for row, frame in enumerate(frames_of([path]))
        if int(frame) in wanted
    }


def write_ply(path: str | Path, mesh: Mesh, colours: np.ndarray | None = None) -> None:
    """Write a binary PLY; `colours` (V, 3) uint8 optional."""
    n_vertices, n_triangles = len(mesh.vertices_mm), len(mesh.triangles)
    fields = [("xyz", "<f4", 3)]
    header = ["ply", "format binary_little_endian 1.0", "comment unit millimetre"]
    header += [f"element vertex {n_vertices}"] + [f"property float {axis}" for axis in "xyz"]
    if colours is not None:
        fields.append(("rgb", "u1", 3))
        header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    header += [f"element face {n_triangles}", "property list uchar int vertex_indices"]
    header += ["end_header", ""]
    vertices = np.zeros(n_vertices, dtype=fields)
    vertices["xyz"] = mesh.vertices_mm
    if colours is not None:
        vertices["rgb"] = colours
    faces = np.zeros(n_triangles, dtype=[("count", "u1"), ("ids", "<i4", 3)])
    faces["count"], faces["ids"] = 3, mesh.triangles
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        stream.write("\n".join(header).encode("ascii"))
        stream.write(vertices.tobytes() + faces.tobytes())


def read_mesh(path: str | Path) -> Mesh:
    """Read a PLY, OBJ or other mesh that trimesh knows, without merging or reordering vertices."""
    import trimesh  # costs two seconds to import, and few callers need it

    try:
        mesh = trimesh.load(path, process=False, maintain_order=True, force="mesh")
    except Exception as error:
        raise InputError(
            f"an unreadable mesh ({error})", "PLY or OBJ", "Export the mesh again.", path=path
        ) from error
    return Mesh(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int32))
