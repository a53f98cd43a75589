"""Where errors are taken: vermilion, mouth mask, face, and the rest that holds the alignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import vertex_areas

#: `visible` is the part of the vermilion that two cameras see in the frame; of **H** alone.
REGION_NAMES = ("vermilion", "visible", "mouth", "face")


@dataclass(frozen=True)
class Regions:
    """Area of each vertex within each region of one topology.

    Attributes:
        weights: region name -> (V,) area in mm2, zero outside the region.
        rest: (V,) area in mm2 of the face outside the mouth mask, for the alignment.
    """

    weights: dict[str, np.ndarray]
    rest: np.ndarray

    @property
    def used(self) -> np.ndarray:
        """(V,) bool: vertices that any region or the alignment needs."""
        return (np.stack(list(self.weights.values())) > 0).any(axis=0) | (self.rest > 0)

    def only(self, *names: str) -> Regions:
        """Some of the regions, by their names."""
        return Regions({name: self.weights[name] for name in names}, self.rest)

    def restricted(self, valid: np.ndarray) -> Regions:
        """The regions of the valid (V,) bool vertices, those with a counterpart in the truth."""
        weights = {name: np.where(valid, w, 0.0) for name, w in self.weights.items()}
        return Regions(weights, np.where(valid, self.rest, 0.0))


def regions_of_mask(
    model: FaceModel, neutral_mm: np.ndarray, mouth_triangles: np.ndarray
) -> Regions:
    """Regions of a topology whose mouth mask is given.

    Args:
        model: V vertices; names the face, the vermilion and the inside of the mouth.
        neutral_mm: (V, 3) of the person, for the areas.
        mouth_triangles: triangles of the correction layer, ids or (T,) bool. The inside of the mouth
            does not count, even where the layer covers it: no camera sees it.
    """
    triangles = model.triangles
    mask = np.zeros(len(triangles), dtype=bool)
    mask[mouth_triangles] = True
    seen = ~(model.regions["mouth_inner"] | model.regions["eyes"] | model.regions["teeth"])
    lips = lip_sides(model) != 0
    face = (model.regions["face"] | lips) & (seen | lips)

    def area(of_triangles: np.ndarray, of_vertices: np.ndarray) -> np.ndarray:
        chosen = triangles[of_triangles]
        return np.where(of_vertices, vertex_areas(neutral_mm, chosen), 0.0)

    everywhere = np.ones(len(triangles), dtype=bool)
    touched = np.zeros(model.n_vertices, dtype=bool)
    touched[triangles[mask].ravel()] = True
    weights = {
        "vermilion": area(everywhere, lips),
        "mouth": area(mask, face),
        "face": area(everywhere, face),
    }
    return Regions(weights, area(everywhere, face & ~touched))


def mask_on(
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    mask_vertices_mm: np.ndarray,
    mask_triangles: np.ndarray,
    reach_mm: float = 2.0,
) -> np.ndarray:
    """Triangles (T,) bool of a mesh that lie on the mask of another mesh in the same pose.

    Args:
        vertices_mm, triangles: the mesh, (V, 3) and (T, 3).
        mask_vertices_mm: (V', 3) of the other mesh.
        mask_triangles: (M, 3), finite corners only.
        reach_mm: largest distance between a triangle's middle and the mask.
    """
    finite = np.isfinite(mask_vertices_mm[mask_triangles]).all(axis=(1, 2))
    surface = Surface(np.nan_to_num(mask_vertices_mm), mask_triangles[finite])
    return surface.closest(vertices_mm[triangles].mean(axis=1)).within(reach_mm).bound
