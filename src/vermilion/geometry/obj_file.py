"""OBJ files as their author made them: quads and wider polygons, negative indices, no reordering."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import numpy as np

from vermilion.geometry.polygons import Polygons


def read_obj(path: Path) -> tuple[np.ndarray, Polygons]:
    """Vertices (V, 3) and polygons of all groups of a file.

    Raises:
        ValueError: a line that cannot be read.
        OSError: no such file.
    """
    points, faces, known = _lines(path, "v")
    if any(len(point) < 3 for point in points):
        raise ValueError("a vertex that has not three coordinates")
    vertices = np.array([point[:3] for point in points], dtype=np.float64).reshape(-1, 3)
    counts = np.array([len(face) for face in faces], dtype=np.int32)
    numbers = np.array([word.partition("/")[0] for word in chain.from_iterable(faces)], dtype=int)
    corners = _from_zero(numbers, np.repeat(np.array(known, dtype=int), counts), "vertex")
    return vertices, Polygons.of_corners(counts, corners, len(vertices))


def read_obj_uv(path: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Texture coordinates (M, 2), v up, and (N,) which of them each corner of the polygons has.

    None where a corner has none.

    Raises:
        ValueError: a line that cannot be read.
        OSError: no such file.
    """
    places, faces, known = _lines(path, "vt")
    words = [word.split("/") for word in chain.from_iterable(faces)]
    if not places or any(len(parts) < 2 or not parts[1] for parts in words):
        return None
    if any(len(place) < 2 for place in places):
        raise ValueError("a texture coordinate that has not two numbers")
    uv = np.array([place[:2] for place in places], dtype=np.float64)
    numbers = np.array([parts[1] for parts in words], dtype=int)
    back = np.repeat(np.array(known, dtype=int), [len(face) for face in faces])
    corners = _from_zero(numbers, back, "texture coordinate")
    if corners.min() < 0 or corners.max() >= len(uv):
        raise ValueError(f"a face with a texture coordinate beyond the {len(uv)} there are")
    return uv, corners.astype(np.int32)


def _lines(path: Path, kind: str) -> tuple[list[list[str]], list[list[str]], list[int]]:
    """Numbers of the lines of a `kind`, corners of the faces, and how many of the kind stand before each."""
    text = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ")
    places: list[list[str]] = []
    faces: list[list[str]] = []
    known: list[int] = []
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == kind:
            places.append(words[1:4])
        elif words[0] == "f":
            faces.append(words[1:])
            known.append(len(places))
    return places, faces, known


def _from_zero(numbers: np.ndarray, known: np.ndarray, what: str) -> np.ndarray:
    """Indices (N,) from 0 of an OBJ's numbers (N,): from 1, or back from the `known` (N,) before."""
    if (numbers == 0).any():
        raise ValueError(f"a face with {what} 0, and OBJ counts from 1")
    return np.where(numbers > 0, numbers - 1, known + numbers)
