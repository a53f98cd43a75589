"""A small face for the evaluation's tests: a curved sheet with a slit for a mouth."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import REGIONS, FaceModel

STEP_MM = 4.0


def sheet_face(step_mm: float = STEP_MM, gap_mm: float = 2.0) -> FaceModel:
    """120 mm x 120 mm, bulging 20 mm; mouth slit 40 mm wide, lips 8 mm high, `gap_mm` open."""
    axis = np.arange(-60.0, 60.0 + step_mm / 2, step_mm)
    n = len(axis)
    x, y = np.meshgrid(axis, axis)
    vertices = np.stack([x, y, 20 - (x**2 + y**2) / 180], axis=-1).reshape(-1, 3)
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    triangles = np.concatenate(
        [np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    )
    # The slit: vertices of the row y = 0 are doubled; triangles above it take the copies.
    row = np.flatnonzero((np.abs(vertices[:, 1]) < 1e-6) & (np.abs(vertices[:, 0]) < 20 - 1e-6))
    copies = np.arange(len(row)) + len(vertices)
    above = vertices[triangles].mean(axis=1)[:, 1] > 0
    rename = np.arange(len(vertices))
    rename[row] = copies
    triangles[above] = rename[triangles[above]]
    vertices = np.concatenate([vertices, vertices[row]])
    open_by = gap_mm / 2 * np.clip(1 - np.abs(vertices[:, 0]) / 20, 0, 1)
    upper = np.zeros(len(vertices), dtype=bool)
    upper[copies] = True
    lower = np.zeros(len(vertices), dtype=bool)
    lower[row] = True
    vertices[upper, 1] += open_by[upper]
    vertices[lower, 1] -= open_by[lower]
    wide = np.abs(vertices[:, 0]) < 20 - 1e-6
    regions = {name: np.zeros(len(vertices), dtype=bool) for name in REGIONS}
    regions["face"] = np.ones(len(vertices), dtype=bool)
    regions["vermilion_upper"] = wide & (upper | ((vertices[:, 1] > 2) & (vertices[:, 1] < 8.5)))
    regions["vermilion_lower"] = wide & (lower | ((vertices[:, 1] < -2) & (vertices[:, 1] > -8.5)))
    regions["rigid"] = vertices[:, 1] > 30
    return FaceModel(
        name="sheet",
        neutral_mm=vertices,
        triangles=triangles.astype(np.int32),
        expression_names=(),
        expressions_mm=np.zeros((0, len(vertices), 3), np.float32),
        identities_mm=np.zeros((0, len(vertices), 3), np.float32),
        uv=np.zeros((len(vertices), 2), np.float32),
        landmarks=np.zeros(66, np.int32),
        outer_contour=row.astype(np.int32),
        inner_contour=np.concatenate([row, copies[::-1]]).astype(np.int32),
        regions=regions,
    )


def mouth_triangles(model: FaceModel, radius_mm: float = 30.0) -> np.ndarray:
    """Ids of the triangles within a radius of the mouth's middle."""
    centres = model.neutral_mm[model.triangles].mean(axis=1)
    return np.flatnonzero(np.linalg.norm(centres[:, :2], axis=1) < radius_mm)
