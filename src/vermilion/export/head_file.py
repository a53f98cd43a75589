"""The user's own head, whose topology the exported files shall have."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from vermilion.geometry.mesh import Mesh, boundary_edges, triangle_areas
from vermilion.geometry.mesh_files import read_polygons
from vermilion.geometry.obj_file import read_obj_uv
from vermilion.geometry.polygons import Polygons
from vermilion.storage.errors import InputError

SUFFIXES = (".obj", ".ply")
_LEAST_TRIANGLES = 200
#: Vertices of borders that are nearer than this share of the head's size are one place.
_SAME = 1e-7


@dataclass(frozen=True)
class HeadFile:
    """A head as its file has it.

    Attributes:
        vertices: (W, 3) in the file's unit and frame.
        polygons: of the W vertices.
        uv: (M, 2), v up; None: the file has none.
        uv_corners: (N,) row of `uv` of each corner of the polygons; None without `uv`.
    """

    vertices: np.ndarray
    polygons: Polygons
    uv: np.ndarray | None = None
    uv_corners: np.ndarray | None = None

    @cached_property
    def place(self) -> np.ndarray:
        """(W,) vertex of `welded` at which each vertex lies; -1 for those of no polygon.

        Exporters cut meshes at texture seams. Only vertices of borders are joined: lips that touch
        stay apart.
        """
        triangles = self.polygons.triangles
        size = max(float(np.ptp(self.vertices, axis=0).max()), 1e-300)
        border = np.unique(boundary_edges(triangles))
        cells = np.round(self.vertices[border] / (_SAME * size)).astype(np.int64)
        _, first, same = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        joined = np.arange(len(self.vertices))
        joined[border] = border[first][same.reshape(-1)]
        corners = joined[triangles]
        kept = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
        number = np.full(len(joined), -1)
        used = np.unique(kept)
        number[used] = np.arange(len(used))
        return number[joined]

    @cached_property
    def welded(self) -> Mesh:
        """The same surface with one vertex a place, in the file's unit and frame."""
        place = self.place
        vertices = np.zeros((place.max() + 1, 3))
        vertices[place[place >= 0]] = self.vertices[place >= 0]
        corners = place[self.polygons.triangles]
        apart = (corners != np.roll(corners, 1, axis=1)).all(axis=1) & (corners >= 0).all(axis=1)
        return Mesh(vertices, corners[apart].astype(np.int32))


def read_head(path: str | Path, subject: str | None = None) -> HeadFile:
    """Read an OBJ or PLY with its polygons, vertex order and (OBJ) texture coordinates.

    Raises:
        InputError: no such file, another suffix, no mesh, too few triangles.
    """
    path, place = Path(path), {"subject": subject, "path": path}
    hint = "Export the head as OBJ with its polygons, and correct apply.export.topology."
    if not path.is_file():
        raise InputError("no such file", "a head (OBJ or PLY)", hint, **place)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"the suffix '{path.suffix}'", f"one of {', '.join(SUFFIXES)}", hint, **place
        )
    vertices, polygons = read_polygons(path)
    try:
        found = read_obj_uv(path) if path.suffix.lower() == ".obj" else None
    except (ValueError, OverflowError) as error:
        raise InputError(f"texture coordinates that cannot be read ({error})", "none, or one a corner",
                         hint, **place) from error  # fmt: skip
    size = max(float(np.ptp(vertices, axis=0).max(initial=0.0)), 1e-300)
    whole = int((triangle_areas(vertices / size, polygons.triangles) > 1e-14).sum())
    if whole < _LEAST_TRIANGLES:
        raise InputError(
            f"{whole} triangles with an area",
            f"a head of at least {_LEAST_TRIANGLES}",
            hint,
            **place,
        )
    return HeadFile(vertices, polygons, *(found or (None, None)))
