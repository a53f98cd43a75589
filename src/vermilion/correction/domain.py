"""Which vertices the integration may move, and how strongly each is held.

Four kinds of vertices:

- *mask*: corners of the layer's triangles; free;
- *followers*: parts that hang on the mask alone (the inside of the lips where the mask ends there);
  free, and kept like the coarse mesh by a small weight, so that they go where the lips go;
- *seam*: the ring round the mask, at most `seam_mm` along the surface; free, kept like the coarse
  mesh, and held in place the more firmly the further out, so that the border shows no crease;
- the rest of the face: fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.contours import edge_graph, geodesic_distance
from vermilion.geometry.mesh import adjacency, connected_parts, unique_edges
from vermilion.storage.errors import InputError

#: How stiff a follower's triangle is beside one of the mask.
FOLLOWER_WEIGHT = 0.05


@dataclass(frozen=True)
class Domain:
    """The part of a mesh that takes part in the integration.

    Attributes:
        free: (N,) vertex ids that may move, ascending.
        kept: (K, 3) triangles outside the mask with a free corner: they stay as they are.
        kept_weight: (K,) stiffness beside a mask triangle.
        hold: (N,) how firmly each free vertex is held, as a share of its own stiffness.
    """

    free: np.ndarray
    kept: np.ndarray
    kept_weight: np.ndarray
    hold: np.ndarray


def integration_domain(
    vertices_mm: np.ndarray, triangles: np.ndarray, mask: np.ndarray, seam_mm: float = 16.0
) -> Domain:
    """Find the free vertices round a mask.

    Args:
        vertices_mm: (V, 3) neutral.
        triangles: (T, 3).
        mask: (M,) ids of the layer's triangles.
        seam_mm: width of the soft ring outside the mask; 0 fixes the mask's own border.
    """
    n_vertices = len(vertices_mm)
    in_mask = np.zeros(n_vertices, dtype=bool)
    in_mask[triangles[mask]] = True
    if in_mask[triangles].all():
        raise InputError(
            "a correction mask that covers the whole mesh",
            "vertices outside it, which hold the corrected mesh in place",
            "Lower `correspondence.mask_radius_mm`.",
        )
    followers = _followers(vertices_mm, triangles, in_mask)
    outside = ~(in_mask | followers)

    others = np.setdiff1d(np.arange(len(triangles)), mask)
    if seam_mm > 0:
        graph = edge_graph(vertices_mm, triangles)
        far = geodesic_distance(graph, np.flatnonzero(in_mask | followers))
        free = in_mask | followers | (far < seam_mm)
        fraction = np.clip(np.where(np.isfinite(far), far, 0.0) / seam_mm, 0.0, 0.999)
        hold = np.where(outside, fraction**2 / (1.0 - fraction) ** 2, 0.0)
    else:
        touches_outside = (adjacency(triangles, n_vertices) @ outside.astype(float)) > 0
        on_border = touches_outside | _on_outer_border(triangles[others], in_mask, followers)
        free = (in_mask & ~on_border) | followers
        hold = np.zeros(n_vertices)
    kept = others[free[triangles[others]].any(axis=1)]
    weight = np.where(followers[triangles[kept]].any(axis=1), FOLLOWER_WEIGHT, 1.0)
    ids = np.flatnonzero(free)
    return Domain(ids, triangles[kept], weight, hold[ids])


def _on_outer_border(others: np.ndarray, in_mask: np.ndarray, followers: np.ndarray) -> np.ndarray:
    """Mask vertices of the `others`, triangles outside the mask, but for those with followers."""
    border = np.zeros(len(in_mask), dtype=bool)
    border[others[~followers[others].any(axis=1)]] = True
    return border & in_mask


def _followers(vertices_mm: np.ndarray, triangles: np.ndarray, in_mask: np.ndarray) -> np.ndarray:
    """Vertices of the parts that hang on the mask from within, (V,) bool.

    With the mask taken away the mesh falls into parts. The largest is the face. Any other that
    touched the mask hangs on it if it lies well inside the mask's reach, as the inside of a mouth
    does; a forehead or a jaw cut off by a wide mask lies outside.
    """
    n_vertices = len(vertices_mm)
    edges = unique_edges(triangles)
    outer = edges[~in_mask[edges].any(axis=1)]
    part = connected_parts(outer, n_vertices)
    centre = vertices_mm[in_mask].mean(axis=0)
    distance = np.linalg.norm(vertices_mm - centre, axis=1)
    mean_distance = np.bincount(part, distance) / np.bincount(part)
    inside = mean_distance < 0.7 * distance[in_mask].max()
    inside[np.bincount(part[~in_mask]).argmax()] = False
    crossing = edges[in_mask[edges].sum(axis=1) == 1]
    touched = np.zeros(len(inside), dtype=bool)
    touched[part[crossing[~in_mask[crossing]]]] = True
    return (inside & touched)[part] & ~in_mask
