"""Which vertices of a face model are which lip."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import adjacency

_GROW_RINGS = 2


def lip_labels(model: FaceModel) -> np.ndarray:
    """(V,) int8: 1 upper vermilion, 2 lower, 0 elsewhere."""
    labels = np.zeros(model.n_vertices, dtype=np.int8)
    labels[model.regions["vermilion_upper"]] = 1
    labels[model.regions["vermilion_lower"]] = 2
    return labels


def lips_with_inside(model: FaceModel) -> np.ndarray:
    """(V,) int8: 1 upper lip, 2 lower, 0 neither; the vermilion and a little of the lips' inside."""
    labels = lip_labels(model)
    neighbours = adjacency(model.triangles, model.n_vertices)
    for _ in range(_GROW_RINGS):
        upper, lower = (neighbours @ (labels == side) > 0 for side in (1, 2))
        free = (labels == 0) & model.regions["mouth_inner"] & ~(upper & lower)
        labels = np.where(free & upper, 1, np.where(free & lower, 2, labels)).astype(np.int8)
    return labels
