"""OBJ files, one a frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.storage.files import atomic_path


def write_obj(
    path: str | Path, vertices_mm: np.ndarray, triangles: np.ndarray, uv: np.ndarray | None = None
) -> None:
    """Write `vertices_mm` (V, 3), `triangles` (T, 3) and, if given, `uv` (V, 2) as OBJ in millimetres."""
    with atomic_path(path) as temporary, open(temporary, "w") as stream:
        stream.write("# millimetres\n")
        np.savetxt(stream, vertices_mm, "v %.4f %.4f %.4f")
        ids = np.asarray(triangles) + 1
        if uv is None:
            np.savetxt(stream, ids, "f %d %d %d")
            return
        np.savetxt(stream, uv, "vt %.5f %.5f")
        np.savetxt(stream, np.repeat(ids, 2, axis=1), "f %d/%d %d/%d %d/%d")
