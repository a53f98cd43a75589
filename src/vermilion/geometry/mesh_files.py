"""Mesh files: PLY written, PLY, OBJ and others read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.obj_file import read_obj
from vermilion.geometry.ply_file import read_ply
from vermilion.geometry.polygons import Polygons
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path

MESH_SUFFIXES = (".obj", ".ply", ".stl")


def write_ply(path: str | Path, mesh: Mesh) -> None:
    """Write a binary PLY."""
    n_vertices, n_triangles = len(mesh.vertices_mm), len(mesh.triangles)
    header = ["ply", "format binary_little_endian 1.0", "comment unit millimetre"]
    header += [f"element vertex {n_vertices}"] + [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {n_triangles}", "property list uchar int vertex_indices"]
    header += ["end_header", ""]
    faces = np.zeros(n_triangles, dtype=[("count", "u1"), ("ids", "<i4", 3)])
    faces["count"], faces["ids"] = 3, mesh.triangles
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        stream.write("\n".join(header).encode("ascii"))
        stream.write(mesh.vertices_mm.astype("<f4").tobytes() + faces.tobytes())


def read_mesh(path: str | Path) -> Mesh:
    """Read a PLY, OBJ or other mesh that trimesh knows, without merging or reordering vertices."""
    import trimesh  # costs two seconds to import, and few callers need it

    try:
        # `force` makes it a Trimesh, which the annotations of trimesh do not tell.
        mesh: Any = trimesh.load(
            path, process=False, maintain_order=True, force="mesh", skip_materials=True
        )
    except Exception as error:
        raise InputError(
            f"an unreadable mesh ({error})", "PLY or OBJ", "Export the mesh again.", path=path
        ) from error
    return Mesh(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int32))


def read_polygons(path: str | Path) -> tuple[np.ndarray, Polygons]:
    """Vertices (V, 3) and polygons of an OBJ, PLY or STL, as the file has them and in its order.

    An STL has three vertices a triangle, which nothing joins.

    Raises:
        InputError: the file is unreadable or has no face.
    """
    path = Path(path)
    try:
        if path.suffix.lower() == ".obj":
            vertices, polygons = read_obj(path)
        elif path.suffix.lower() == ".ply":
            vertices, polygons = read_ply(path)
        else:
            mesh = read_mesh(path)
            vertices = mesh.vertices_mm
            counts = np.full(len(mesh.triangles), 3)
            polygons = Polygons.of_corners(counts, mesh.triangles.ravel(), len(vertices))
        if len(polygons) == 0:
            raise ValueError("no face")
    except (OSError, ValueError, IndexError, KeyError, OverflowError, MemoryError) as error:
        raise InputError(
            f"an unreadable mesh ({error!s:.200})", "OBJ, PLY or STL", "Export the mesh again.",
            path=path,
        ) from error  # fmt: skip
    if not np.isfinite(vertices).all():
        raise InputError(
            "vertices that are not finite", "numbers", "Export the mesh again.", path=path
        )
    return vertices, polygons
