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
    text = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ")
    points: list[list[str]] = []
    faces: list[list[str]] = []
    known: list[int] = []  # vertices before each face, for indices that count back
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            points.append(words[1:4])
        elif words[0] == "f":
            faces.append(words[1:])
            known.append(len(points))
    if any(len(point) != 3 for point in points):
        raise ValueError("a vertex that has not three coordinates")
    vertices = np.array(points, dtype=np.float64).reshape(-1, 3)
    counts = np.array([len(face) for face in faces], dtype=np.int32)
    numbers = np.array([word.partition("/")[0] for word in chain.from_iterable(faces)], dtype=int)
    back = np.repeat(np.array(known, dtype=int), counts)
    if (numbers == 0).any():
        raise ValueError("a face with vertex 0, and OBJ counts from 1")
    corners = np.where(numbers > 0, numbers - 1, back + numbers)
    return vertices, Polygons.of_corners(counts, corners, len(vertices))
