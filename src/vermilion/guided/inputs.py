"""What a person gives for a frame: sketches in the take's cameras, or a sculpted mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vermilion.external.read import read_tracked
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import read_mesh
from vermilion.guided.sculpt_files import USD_SUFFIXES
from vermilion.guided.sketch import Sketch, read_sketch
from vermilion.storage.errors import InputError


def sketch_cameras(
    cameras: Mapping[str, Camera], tracked: Camera, of_track: bool
) -> dict[str, Camera]:
    """The cameras that sketches of a sequence are drawn in, by name.

    Args:
        cameras: of the take.
        tracked: the monocular camera as the tracker used it.
        of_track: whether the sequence was made in that camera (C, or corrected C), not from the rig.
    """
    return {**cameras, tracked.name: tracked if of_track else cameras.get(tracked.name, tracked)}


def read_sketch_views(
    paths: Sequence[str | Path], cameras: Mapping[str, Camera], frame: int
) -> list[tuple[Sketch, Camera]]:
    """Sketches of one frame with the cameras of their images.

    Args:
        paths: sketch files `<camera>/<frame:06d>.json`.
        cameras: by name.
        frame: that the sketches must be of.

    Raises:
        InputError: a file that is no sketch, is of another frame or camera than its name says, or
            of a camera that the take does not have.
    """
    views = []
    for path in map(Path, paths):
        sketch = read_sketch(path)
        named = path.parent.name
        if (sketch.camera, sketch.frame) != (named, frame):
            raise InputError(
                f"a sketch of camera {sketch.camera}, frame {sketch.frame}",
                f"camera {named}, frame {frame}, as the file is named",
                "Rename the file, or correct what it says.",
                path=path,
            )
        if named not in cameras:
            raise InputError(
                f"a sketch of camera {named}",
                f"one of the take's cameras: {', '.join(sorted(cameras))}",
                "Draw on an image of such a camera.",
                path=path,
            )
        views.append((sketch, cameras[named]))
    return views


def read_sculpt(
    path: str | Path, triangles: np.ndarray, n_vertices: int, unit_mm: float = 1.0
) -> np.ndarray:
    """A sculpted mesh of the sequence's topology, (V, 3) mm.

    Args:
        path: OBJ, PLY or USD; an animated USD is read at the frame that the file is named after.
        triangles: (T, 3) of the sequence.
        n_vertices: V.
        unit_mm: length of the unit of OBJ and PLY; USD names its own.

    Raises:
        InputError: another topology, or numbers that are not finite.
    """
    mesh = _read_sculpted(Path(path), unit_mm)
    same = mesh.triangles.shape == triangles.shape and (mesh.triangles == triangles).all()
    if len(mesh.vertices_mm) != n_vertices or not same:
        raise InputError(
            f"a sculpt of {len(mesh.vertices_mm)} vertices and {len(mesh.triangles)} triangles",
            f"the sequence's {n_vertices} vertices and {len(triangles)} triangles in their order",
            "Export the frame from the corrected sequence, sculpt it, and keep the order of vertices.",
            path=path,
        )
    if not np.isfinite(mesh.vertices_mm).all():
        raise InputError(
            "a sculpt with vertices that are not finite", "finite numbers", "Export it again.",
            path=path,
        )  # fmt: skip
    return mesh.vertices_mm


def _read_sculpted(path: Path, unit_mm: float) -> Mesh:
    if path.suffix.lower() not in USD_SUFFIXES:
        mesh = read_mesh(path)
        return mesh.with_vertices(mesh.vertices_mm * unit_mm)
    found = read_tracked(path, [int(path.stem) if path.stem.isdigit() else 0])
    return Mesh(found.vertices_mm[0].astype(np.float64), found.triangles)
