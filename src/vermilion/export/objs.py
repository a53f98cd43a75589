"""OBJ and PLY files, one a frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.export.animation import Animation
from vermilion.geometry.polygons import Polygons
from vermilion.storage.files import atomic_folder, atomic_path
from vermilion.storage.progress import progress


def write_obj(
    path: str | Path,
    vertices: np.ndarray,
    polygons: Polygons | np.ndarray,
    uv: np.ndarray | None = None,
    uv_corners: np.ndarray | None = None,
) -> None:
    """Write vertices (V, 3), polygons (or triangles (T, 3)) and, if given, uv (V, 2, v up) as OBJ.

    With `uv_corners` (N,), the uv of each corner, uv is (M, 2).
    """
    if isinstance(polygons, np.ndarray):
        polygons = Polygons.of_triangles(polygons)
    with atomic_path(path) as temporary:
        temporary.write_text(_vertex_lines(vertices) + _topology_lines(polygons, uv, uv_corners))


def write_objs(folder: str | Path, animation: Animation) -> None:
    """Write `<frame:06d>.obj` of every frame that has a mesh, in the animation's unit."""
    topology = _topology_lines(animation.polygons, animation.uv, animation.uv_corners)
    with atomic_folder(folder) as temporary:
        for row in progress(animation.rows, "OBJ"):
            vertices = np.asarray(animation.vertices_mm[row], np.float64) / animation.unit_mm
            path = temporary / f"{int(animation.frames[row]):06d}.obj"
            path.write_text(_vertex_lines(vertices) + topology)


def write_plys(folder: str | Path, animation: Animation) -> None:
    """Write `<frame:06d>.ply` (binary) of every frame that has a mesh, in the animation's unit."""
    faces = _ply_faces(animation.polygons)
    # A PLY has texture coordinates of vertices alone: those of a mesh with seams are left out.
    uv = animation.uv if animation.uv_corners is None else None
    fields = ["x", "y", "z"] + (["s", "t"] if uv is not None else [])
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment a unit is {animation.unit_mm:g} mm"]
    header += [f"element vertex {len(animation.neutral_mm)}"]
    header += [f"property float {name}" for name in fields]
    header += [f"element face {len(animation.polygons)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    start = "\n".join(header).encode("ascii")
    with atomic_folder(folder) as temporary:
        for row in progress(animation.rows, "PLY"):
            table = np.asarray(animation.vertices_mm[row], np.float64) / animation.unit_mm
            if uv is not None:
                table = np.concatenate([table, uv], axis=1)
            path = temporary / f"{int(animation.frames[row]):06d}.ply"
            path.write_bytes(start + table.astype("<f4").tobytes() + faces)


def _vertex_lines(vertices: np.ndarray) -> str:
    numbers = np.asarray(vertices, dtype=np.float32).ravel().tolist()
    return ("v %.9g %.9g %.9g\n" * len(vertices)) % tuple(numbers)


def _topology_lines(
    polygons: Polygons, uv: np.ndarray | None, uv_corners: np.ndarray | None = None
) -> str:
    lines = []
    if uv is not None:
        lines.append(("vt %.6f %.6f\n" * len(uv)) % tuple(np.asarray(uv, float).ravel().tolist()))
    corners, at = (polygons.corners + 1).tolist(), 0
    words = [str(corner) for corner in corners]
    if uv is not None:
        places = corners if uv_corners is None else (uv_corners + 1).tolist()
        words = [f"{word}/{place}" for word, place in zip(words, places, strict=True)]
    for count in polygons.counts.tolist():
        lines.append(f"f {' '.join(words[at : at + count])}\n")
        at += count
    return "".join(lines)


def _ply_faces(polygons: Polygons) -> bytes:
    """The faces' part of a binary PLY: of each a byte with its count, then its corners."""
    sizes = 1 + 4 * polygons.counts.astype(np.int64)
    starts = np.cumsum(sizes) - sizes
    data = np.zeros(int(sizes.sum()), dtype=np.uint8)
    data[starts] = polygons.counts
    owner = np.repeat(np.arange(len(polygons)), polygons.counts)
    first = np.cumsum(polygons.counts) - polygons.counts
    at = starts[owner] + 1 + 4 * (np.arange(len(owner)) - first[owner])
    data[at[:, None] + np.arange(4)] = polygons.corners.astype("<i4").view(np.uint8).reshape(-1, 4)
    return data.tobytes()
