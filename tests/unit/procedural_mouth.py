"""Measures of a generated head's mouth in an expression, for tests."""

from __future__ import annotations

import numpy as np

from tests.heads import SLIGHTLY_OPEN
from vermilion.faces.model import FaceModel
from vermilion.geometry.raycast import RayCaster


def weights_of(model: FaceModel, **weights: float) -> np.ndarray:
    result = np.zeros(model.n_expressions)
    for name, value in weights.items():
        result[model.expression_names.index(name)] = value
    return result


def mouth(model: FaceModel, jaw: float = SLIGHTLY_OPEN, identity=None, **weights) -> np.ndarray:
    return model.vertices(identity, weights_of(model, **({"jawOpen": jaw} | weights)))


def lip_triangles(model: FaceModel, which: str) -> np.ndarray:
    """Triangles of one lip with its inner fold, told apart by where the neutral's lips meet."""
    other = "vermilion_lower" if which == "vermilion_upper" else "vermilion_upper"
    loop = model.neutral_mm[model.inner_contour]
    line_y = np.interp(model.neutral_mm[:, 0], np.sort(loop[:, 0]), loop[np.argsort(loop[:, 0]), 1])
    above = model.neutral_mm[:, 1] > line_y
    inner = model.regions["mouth_inner"] & (above if which == "vermilion_upper" else ~above)
    inner &= model.neutral_mm[:, 2] > model.neutral_mm[model.inner_contour, 2].max() - 7.0
    keep = (model.regions[which] & ~model.regions[other]) | inner
    return model.triangles[keep[model.triangles].all(axis=1)]


def caster_of(vertices: np.ndarray, triangles: np.ndarray) -> RayCaster:
    """Of a small part of a mesh: without the vertices that it does not use, which take longer than it does."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    return RayCaster(vertices[used], renumbered.reshape(triangles.shape))


def lip_gap_mm(model: FaceModel, vertices: np.ndarray) -> float:
    """Least vertical distance from the lower lip's top to the upper lip's underside."""
    x, z = np.meshgrid(np.arange(-30, 30, 0.5), np.arange(60, 115, 0.5))
    below, above = np.stack([x, 0 * x - 200, z], -1), np.stack([x, 0 * x + 200, z], -1)
    up = np.broadcast_to([0.0, 1.0, 0.0], below.shape)
    upper = caster_of(vertices, lip_triangles(model, "vermilion_upper")).cast(below, up)
    lower = caster_of(vertices, lip_triangles(model, "vermilion_lower")).cast(above, -up)
    gap = (upper.distance_mm - 200.0) - (200.0 - lower.distance_mm)
    return float(gap[upper.hit & lower.hit].min(initial=np.inf))


def aperture_mm(model: FaceModel, vertices: np.ndarray) -> float:
    """Distance between the middles of the inner contours."""
    ids = model.landmarks
    return float(np.linalg.norm(vertices[ids[60]] - vertices[ids[64]]))


def visible_red_mm2(model: FaceModel, vertices: np.ndarray, region: str) -> float:
    """Area of a lip's red in an orthographic frontal view."""
    step = 0.4
    x, y = np.meshgrid(np.arange(-35, 35, step), np.arange(-75, -15, step))
    origins = np.stack([x, y, 0 * x + 300], -1)
    hits = RayCaster(vertices, model.triangles).cast(
        origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    )
    red = model.regions[region][model.triangles[np.maximum(hits.triangle, 0)]].all(axis=-1)
    return float((red & hits.hit).sum() * step**2)
