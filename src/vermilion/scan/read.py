"""A scan from a file: any triangle or polygon mesh, any topology, any unit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from vermilion.geometry.mesh import Mesh, triangle_areas
from vermilion.geometry.polygons import Polygons
from vermilion.storage.errors import InputError

SUFFIXES = (".obj", ".ply", ".stl")
LEAST_TRIANGLES = 200


def read_scan(path: str | Path, subject: str | None = None) -> Mesh:
    """A scan in its own units and frame; corners at one place are one vertex.

    Polygons are cut into triangles; triangles without area, and vertices that none has, are left out.

    Raises:
        InputError: no such file, no mesh, too few triangles, coordinates that are no numbers.
    """
    path, place = Path(path), {"subject": subject, "path": path}
    hint = "Export the scan as a triangle mesh, OBJ or PLY, in any unit."
    if not path.is_file():
        raise InputError("no such file", "a scan", "Correct tracking.scans.", **place)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"the suffix '{path.suffix}'", f"one of {', '.join(SUFFIXES)}", hint, **place
        )
    try:
        loaded: Any = trimesh.load(path, process=False, force="mesh", skip_materials=True)
        vertices = np.asarray(loaded.vertices, dtype=np.float64).reshape(-1, 3)
        triangles = np.asarray(loaded.faces, dtype=np.int64).reshape(-1, 3)
        Polygons.of_corners(np.full(len(triangles), 3), triangles.ravel(), len(vertices))
    except Exception as error:  # trimesh raises many kinds
        raise InputError(f"no mesh that can be read ({error})", "a mesh", hint, **place) from error
    if len(triangles) and not np.isfinite(vertices).all():
        raise InputError("coordinates that are no numbers", "finite ones", hint, **place)
    mesh = _welded(vertices, triangles)
    if len(mesh.triangles) < LEAST_TRIANGLES:
        raise InputError(
            f"{len(mesh.vertices_mm)} vertices and {len(mesh.triangles)} triangles with an area",
            f"the surface of a face, at least {LEAST_TRIANGLES} triangles",
            "Reconstruct a surface first: point clouds have none. " + hint,
            **place,
        )
    return mesh


def _welded(vertices: np.ndarray, triangles: np.ndarray) -> Mesh:
    """Vertices of one place joined (texture seams double them), the useless left out."""
    if not len(triangles):
        return Mesh(vertices, triangles)
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-300)
    _, first, same = np.unique(
        np.round(vertices / (1e-7 * size)).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    vertices, triangles = vertices[first], same.reshape(-1)[triangles]
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles = triangles[distinct]
    triangles = triangles[triangle_areas(vertices / size, triangles) > 1e-14]
    used, renumbered = np.unique(triangles, return_inverse=True)
    return Mesh(vertices[used], renumbered.reshape(-1, 3).astype(np.int32))
