"""Coefficients of the coarse expression in a small linear space (Lips16 5.1, psi)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import vertex_areas


@dataclass(frozen=True)
class ShapeSpace:
    """Principal components of the tracker's blend shapes.

    The components are orthonormal under the area-weighted mean over the face's skin, so that a
    coefficient is a root-mean-square displacement in millimetres whatever the mesh's density.

    Attributes:
        projection: (P, 3 V) float64; coefficients = projection @ displacement.
        kept: share of the blend shapes' variance that the P components hold.
    """

    projection: np.ndarray
    kept: float

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.projection)

    def coefficients(self, displacement_mm: np.ndarray) -> np.ndarray:
        """Coefficients (F, P) mm of `displacement_mm` (F, V, 3) from the neutral, head frame."""
        return displacement_mm.reshape(len(displacement_mm), -1) @ self.projection.T


def shape_space(model: FaceModel, variance: float) -> ShapeSpace:
    """Components that hold a share `variance` of the model's blend shapes.

    The second moment is taken about the neutral (no mean is removed): the neutral then has
    coefficients of zero, and every weighted sum of blend shapes lies in the whole space.

    Raises ValueError for a model without expressions.
    """
    if model.n_expressions == 0:
        raise ValueError(f"face model {model.name}: no expressions to make a shape space of")
    area = vertex_areas(model.neutral_mm, model.triangles) * model.regions["face"]
    root = np.sqrt(area / area.sum())
    shapes = model.expressions_mm.astype(np.float64) * root[:, None]
    _, sizes, components = np.linalg.svd(
        shapes.reshape(model.n_expressions, -1), full_matrices=False
    )
    share = np.cumsum(sizes**2) / np.sum(sizes**2)
    count = min(int(np.searchsorted(share, variance)) + 1, int((sizes > 1e-9 * sizes[0]).sum()))
    components = components[:count]
    # Singular vectors have no sign of their own: the largest entry is positive.
    largest = np.abs(components).argmax(axis=1)
    components *= np.sign(components[np.arange(count), largest])[:, None]
    return ShapeSpace(components * np.repeat(root, 3), float(share[count - 1]))
