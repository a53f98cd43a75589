"""The patch of skin round the lips in texture space: where it is baked, filtered and painted.

A domain depends on the template alone, so a texture of one take fits every other take of every
subject in the same topology.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from vermilion.faces.contours import edge_graph, geodesic_distance
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import connected_parts, triangle_areas, unique_edges
from vermilion.geometry.raycast import RayCaster
from vermilion.storage.errors import InputError

#: A chart may stretch an edge, or shrink a triangle, this much against the lips; else it is a seam.
_STRETCH_LIMIT = 20.0
_SHRINK_LIMIT = 30.0


@dataclass(frozen=True)
class LipDomain:
    """A grid of texels over the lips and the skin round them.

    Row 0 is the top (largest v); texel centres are at whole numbers plus 0.5, as pixels.

    Attributes:
        in_domain: (T,) bool, triangles that carry texture.
        skin: (T,) bool, triangles of the outer face, in the domain or not.
        lip: (T,) int8: +1 upper vermilion, -1 lower, 0 elsewhere.
        corners: (2,) vertices at both ends of the lips.
        texel_of_vertex: (V, 2) x, y in texels of each vertex.
        triangle: (h, w) int32 triangle of the mesh at each texel, -1 outside.
        barycentric: (h, w, 3) float32 at each texel.
        lip_distance_mm: (h, w) float32 distance to the vermilion along the skin; 0 on it.
        inner: (h, w) bool, the inside of the lips, past the vermilion.
        position_mm: (h, w, 3) float32 place on the template's neutral.
        texel_mm: median edge of a texel on the template's neutral.
    """

    in_domain: np.ndarray
    skin: np.ndarray
    lip: np.ndarray
    corners: np.ndarray
    texel_of_vertex: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    lip_distance_mm: np.ndarray
    inner: np.ndarray
    position_mm: np.ndarray
    texel_mm: float

    @property
    def shape(self) -> tuple[int, int]:
        return self.triangle.shape

    @property
    def valid(self) -> np.ndarray:
        """(h, w) bool, texels that lie on the mesh."""
        return self.triangle >= 0

    def distance_mm(self, mask: np.ndarray, limit_mm: float) -> np.ndarray:
        """Distance along the surface to the texels of a mask, (h, w); infinite beyond the limit.

        `mask` (h, w) bool. Texels do not measure length: a chart stretches the corners of the
        mouth.
        """
        distance = np.full(self.shape, np.inf, dtype=np.float32)
        sources = self._node[mask & self.valid]
        if len(sources):
            distance[self.valid] = csgraph.dijkstra(
                self._graph, directed=False, indices=sources, min_only=True, limit=limit_mm
            )
        return distance

    @cached_property
    def _node(self) -> np.ndarray:
        """Number of each valid texel, (h, w), -1 elsewhere."""
        return np.where(self.valid, np.cumsum(self.valid).reshape(self.shape) - 1, -1)

    @cached_property
    def _graph(self) -> sparse.csr_matrix:
        """Each valid texel joined to its eight neighbours, weights in millimetres."""
        rows, columns, lengths = [], [], []
        height, width = self.shape
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = (slice(0, height - dy), slice(max(0, -dx), width - max(0, dx)))
            there = (slice(dy, height), slice(max(0, dx), width - max(0, -dx)))
            both = self.valid[here] & self.valid[there]
            rows.append(self._node[here][both])
            columns.append(self._node[there][both])
            step = self.position_mm[here][both] - self.position_mm[there][both]
            lengths.append(np.maximum(np.linalg.norm(step, axis=1), 1e-6))
        size = (int(self.valid.sum()),) * 2
        joined = (np.concatenate(rows), np.concatenate(columns))
        return sparse.csr_matrix((np.concatenate(lengths), joined), shape=size)

    def texels(self) -> tuple[np.ndarray, np.ndarray]:
        """Triangle (n,) and barycentric weights (n, 3) of the valid texels, row by row."""
        return self.triangle[self.valid], self.barycentric[self.valid]

    def image(self, values: np.ndarray) -> np.ndarray:
        """Values `values` (n, ...) of the valid texels as an image (h, w, ...), zero elsewhere."""
        filled = np.zeros((*self.shape, *values.shape[1:]), dtype=values.dtype)
        filled[self.valid] = values
        return filled


def lip_domain(model: FaceModel, skin_mm: float, inner_mm: float, texel_mm: float) -> LipDomain:
    """The domain of a template.

    Args:
        model: the template of H.
        skin_mm: how far the domain reaches onto the skin.
        inner_mm: how far it reaches inside the mouth, past the vermilion.
        texel_mm: edge of a texel on the neutral.

    Raises InputError where the model has no vermilion or no chart over it.
    """
    vermilion = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    if not vermilion.any():
        raise InputError(
            f"face model {model.name} without a vermilion region",
            "regions vermilion_upper and vermilion_lower",
            "Use a template whose lips are marked.",
        )
    graph = edge_graph(model.neutral_mm, model.triangles)
    distance = geodesic_distance(graph, np.flatnonzero(vermilion), max(skin_mm, inner_mm))
    inside = model.regions["mouth_inner"] & ~vermilion
    never = model.regions["teeth"] | model.regions["eyes"]
    keep = np.where(inside, distance <= inner_mm, distance <= skin_mm) & ~never
    in_domain = _charted(model, keep[model.triangles].all(axis=1), vermilion)
    scale = _texels_per_uv(model, in_domain, texel_mm)
    used = model.uv[model.triangles[in_domain]].reshape(-1, 2).astype(np.float64)
    low, high = used.min(axis=0), used.max(axis=0)
    texel = np.stack(
        [(model.uv[:, 0] - low[0]) * scale[0], (high[1] - model.uv[:, 1]) * scale[1]], axis=1
    )
    width, height = np.ceil((high - low) * scale).astype(int)
    triangle, barycentric = _rasterise(texel, model.triangles, in_domain, (height, width))
    corners = model.triangles[np.maximum(triangle, 0)]
    inner = (inside[corners] * barycentric).sum(axis=-1) > 0.5
    lip_distance = (np.minimum(distance, 1e6)[corners] * barycentric).sum(axis=-1)
    outer = ~(model.regions["mouth_inner"] | never)
    return LipDomain(
        in_domain,
        outer[model.triangles].any(axis=1),
        _lip_of_triangle(model),
        _ends_of(model, vermilion),
        texel,
        triangle,
        barycentric,
        lip_distance.astype(np.float32),
        inner & (triangle >= 0),
        (model.neutral_mm[corners] * barycentric[..., None]).sum(axis=-2).astype(np.float32),
        texel_mm,
    )


def _lip_of_triangle(model: FaceModel) -> np.ndarray:
    upper, lower = model.regions["vermilion_upper"], model.regions["vermilion_lower"]
    red = (upper | lower)[model.triangles].all(axis=1)
    is_upper = upper[model.triangles].sum(axis=1) >= 2
    return np.where(red, np.where(is_upper, 1, -1), 0).astype(np.int8)


def _ends_of(model: FaceModel, vermilion: np.ndarray) -> np.ndarray:
    """Vertices of the vermilion furthest apart along its main axis on the neutral, (2,)."""
    red = np.flatnonzero(vermilion)
    points = model.neutral_mm[red] - model.neutral_mm[red].mean(axis=0)
    along = points @ np.linalg.eigh(points.T @ points)[1][:, -1]
    return red[[along.argmin(), along.argmax()]]


def _charted(model: FaceModel, candidates: np.ndarray, vermilion: np.ndarray) -> np.ndarray:
    """Candidates (T,) whose chart has no seam or fold and is connected to the lips, (T,) bool."""
    uv = model.uv.astype(np.float64)
    a, b, c = (uv[model.triangles[:, k]] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    density = signed / np.maximum(triangle_areas(model.neutral_mm, model.triangles), 1e-9)
    on_lips = vermilion[model.triangles].all(axis=1)
    typical = np.median(density[on_lips]) if on_lips.any() else 0.0
    if abs(typical) < 1e-12:
        raise InputError(
            f"face model {model.name} without texture coordinates on the lips",
            "a chart over the lips",
            "Give the template texture coordinates.",
        )
    longest = _edge_stretch(uv, model).max(axis=1)
    sane = candidates & (density / typical > 1 / _SHRINK_LIMIT)
    sane &= longest < _STRETCH_LIMIT * np.median(longest[on_lips])
    part = connected_parts(unique_edges(model.triangles[sane]), model.n_vertices)
    with_lips = np.unique(part[model.triangles[sane & on_lips].reshape(-1)])
    return sane & np.isin(part[model.triangles[:, 0]], with_lips)


def _edge_stretch(uv: np.ndarray, model: FaceModel) -> np.ndarray:
    """Length in the chart over length on the neutral of each triangle's edges, (T, 3)."""
    around = [1, 2, 0]
    chart = uv[model.triangles[:, around]] - uv[model.triangles]
    space = model.neutral_mm[model.triangles[:, around]] - model.neutral_mm[model.triangles]
    return np.linalg.norm(chart, axis=2) / np.maximum(np.linalg.norm(space, axis=2), 1e-6)


def _texels_per_uv(model: FaceModel, in_domain: np.ndarray, texel_mm: float) -> np.ndarray:
    """Texels a unit of u and of v, (2,), so that a texel has the edge asked for."""
    triangles = model.triangles[in_domain]
    uv, xyz = model.uv[triangles].astype(np.float64), model.neutral_mm[triangles]
    uv_edges = np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=2)  # (T, 2, 2)
    xyz_edges = np.stack([xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0]], axis=2)  # (T, 3, 2)
    mm_per_uv = np.linalg.norm(xyz_edges @ np.linalg.inv(uv_edges), axis=1)  # (T, 2)
    return np.median(mm_per_uv, axis=0) / texel_mm


def _rasterise(
    texel: np.ndarray, triangles: np.ndarray, in_domain: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Triangle and barycentric weights under each texel centre: rays onto the flat chart."""
    ids = np.flatnonzero(in_domain)
    flat = np.concatenate([texel, np.zeros((len(texel), 1))], axis=1)
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    origins = np.stack([x, y, np.full(shape, 1.0)], axis=-1)
    down = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    hits = RayCaster(flat, triangles[ids]).cast(origins, down)
    triangle = np.where(hits.hit, ids[np.maximum(hits.triangle, 0)], -1).astype(np.int32)
    return triangle, hits.barycentric
