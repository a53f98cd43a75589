"""What the texture needs to know of every vertex and triangle of a studio model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from vermilion.faces.contours import (
    edge_graph,
    enclosed,
    geodesic_distance,
    upper_side,
)
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import connected_parts, unique_edges
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.studio.kernels import EYE, MOUTH, SKIN, TEETH

#: Reach of the smoothing of the vermilion border, against stairs along the mesh's edges (mm).
BORDER_SMOOTHING_MM = 1.2


@dataclass(frozen=True)
class StudioSurface:
    """Coordinates of the solid texture, one per vertex of the studio model.

    Attributes:
        solid_mm: (V, 3) float32 place in the model's neutral; of an eyeball, from its own centre.
        lip_mm: (V,) float32 distance from the vermilion border, positive on the red side.
        inside_mm: (V,) float32 distance past the line where the lips meet, positive inside.
        upper: (V,) bool, nearer to the upper lip than to the lower.
        material: (T,) uint8 of SKIN, MOUTH (gums, the model's tongue), TEETH, EYE; TONGUE where one is added.
        brows_mm: (2, 5, 2) float32 x and y of both brows in the neutral.
        chin_mm: height of the chin in the neutral.
    """

    solid_mm: np.ndarray
    lip_mm: np.ndarray
    inside_mm: np.ndarray
    upper: np.ndarray
    material: np.ndarray
    brows_mm: np.ndarray
    chin_mm: float


def surface_of(model: FaceModel) -> StudioSurface:
    """Texture coordinates of a studio model; a few seconds at most, once a take."""
    skin, label = _skin_part(model)
    graph = edge_graph(model.neutral_mm, skin)
    lip = _lip_distance(model, skin, graph)
    inside = _inside_distance(model, skin, graph)
    upper = upper_side(graph, model.outer_contour, model.inner_contour, model.landmarks)
    brows = model.neutral_mm[model.landmarks[17:27], :2].reshape(2, 5, 2)
    return StudioSurface(
        solid_mm=_solid(model).astype(np.float32),
        lip_mm=lip.astype(np.float32),
        inside_mm=inside.astype(np.float32),
        upper=upper,
        material=_materials(model, label),
        brows_mm=brows.astype(np.float32),
        chin_mm=float(model.neutral_mm[model.landmarks[8], 1]),
    )


def _skin_part(model: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of the part that the landmarks lie on, and the part number of each vertex."""
    label = connected_parts(unique_edges(model.triangles), model.n_vertices)
    home = label[model.landmarks[8]]
    label = np.where(label == home, -1, label)
    return model.triangles[label[model.triangles[:, 0]] == -1], label


def _lip_distance(model: FaceModel, skin: np.ndarray, graph: sparse.spmatrix) -> np.ndarray:
    loop = model.neutral_mm[model.outer_contour]
    distance = _distance_to_loop(model.neutral_mm, loop)
    off_border = geodesic_distance(graph, model.outer_contour)[model.inner_contour]
    seed = model.inner_contour[np.argmax(np.where(np.isfinite(off_border), off_border, -1))]
    red = enclosed(skin, model.n_vertices, model.outer_contour, int(seed))
    signed = np.where(red, distance, -distance)
    signed[model.outer_contour] = 0.0
    near = np.abs(signed) < 6.0
    laplacian, mass = cotangent_laplacian(model.neutral_mm, skin)
    used = np.unique(skin)
    system = mass + BORDER_SMOOTHING_MM**2 * laplacian
    factor = CholeskyFactor(system[used][:, used])
    smooth = signed.copy()
    smooth[used] = factor.solve((mass @ signed)[used])
    return np.where(near, smooth, signed)


def _inside_distance(model: FaceModel, skin: np.ndarray, graph: sparse.spmatrix) -> np.ndarray:
    distance = geodesic_distance(graph, model.inner_contour)
    apart = ~np.isfinite(distance)
    mouth = model.regions["mouth_inner"] & ~apart
    if not mouth.any():
        raise ValueError("the studio model has no inside of the lips (region mouth_inner)")
    deepest = int(np.argmax(np.where(mouth, distance, -1)))
    past = enclosed(skin, model.n_vertices, model.inner_contour, deepest)
    signed = np.where(past, distance, -distance)
    return np.where(apart, 30.0, signed)


def _distance_to_loop(points: np.ndarray, loop: np.ndarray, subdivision: int = 12) -> np.ndarray:
    following = np.roll(loop, -1, axis=0)
    fractions = np.arange(subdivision)[:, None, None] / subdivision
    samples = (loop + fractions * (following - loop)).reshape(-1, 3)
    return cKDTree(samples).query(points)[0]


def _solid(model: FaceModel) -> np.ndarray:
    """Neutral positions; those of each eyeball from the middle of its bounding box."""
    solid = model.neutral_mm.copy()
    eyes = model.regions["eyes"]
    for side in (-1, 1):  # both shells of an eye share one centre
        eye = eyes & (np.sign(model.neutral_mm[:, 0]) == side)
        if eye.any():
            part = model.neutral_mm[eye]
            solid[eye] -= 0.5 * (part.min(axis=0) + part.max(axis=0))
    return solid


def _materials(model: FaceModel, label: np.ndarray) -> np.ndarray:
    first = model.triangles[:, 0]
    material = np.full(len(model.triangles), SKIN, dtype=np.uint8)
    material[model.regions["mouth_inner"][first] & (label[first] != -1)] = MOUTH
    material[model.regions["teeth"][model.triangles].all(axis=1)] = TEETH
    material[model.regions["eyes"][model.triangles].all(axis=1)] = EYE
    return material
