"""Tangent-space normal and displacement maps: the mesh with relief against the smooth one, in texture space."""

from __future__ import annotations

import numpy as np

from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.mesh import incidence, normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster, interpolate


class NormalMap:
    """Draws the maps of a take; the points of the mesh at the map's pixels are found once."""

    def __init__(self, topology: FineTopology, uv: np.ndarray, size_px: int):
        """`uv` (V, 2) is the coarse mesh's, v upwards; maps are (size_px, size_px)."""
        self.uv, self._triangles = topology.finer @ uv.astype(np.float64), topology.triangles
        middle = (np.arange(size_px) + 0.5) / size_px
        u, v = np.meshgrid(middle, 1 - middle)
        rays = np.stack([u, v, np.ones_like(u)], axis=2)
        # Other regions may overlap the skin in texture space: only the skin is cast.
        skin = self._triangles[topology.skin_of]
        flat = np.concatenate([self.uv, np.zeros((len(self.uv), 1))], axis=1)
        caster = RayCaster(flat, skin)
        self._hits = caster.cast(rays, np.broadcast_to([0.0, 0.0, -1.0], rays.shape))
        self._skin = skin

    def draw(self, smooth_mm: np.ndarray, refined_mm: np.ndarray) -> np.ndarray:
        """Map (size_px, size_px, 3) in [0, 1]: 0.5 + 0.5 n, n in (along u, along v, outwards).

        Off the skin the map is flat.

        Args:
            smooth_mm: (V', 3) smooth fine mesh.
            refined_mm: (V', 3) mesh with relief.
        """
        smooth = vertex_normals(smooth_mm, self._triangles)
        shaped = vertex_normals(refined_mm, self._triangles)
        first = self._along_u(smooth_mm, smooth)
        basis = np.stack([first, np.cross(smooth, first), smooth], axis=1)
        local = np.einsum("vij,vj->vi", basis, shaped)
        found = normalised(interpolate(self._hits, self._skin, local))
        return np.where(self._hits.hit[..., None], 0.5 + 0.5 * found, [0.5, 0.5, 1.0])

    def draw_displacement(self, smooth_mm: np.ndarray, refined_mm: np.ndarray) -> np.ndarray:
        """Map (size_px, size_px) in mm: how far the relief lies outwards along the smooth mesh's normal; 0 off the skin.

        Args:
            smooth_mm, refined_mm: (V', 3) as in `draw`.
        """
        normals = vertex_normals(smooth_mm, self._triangles)
        outwards = ((refined_mm - smooth_mm) * normals).sum(axis=1, keepdims=True)
        found = interpolate(self._hits, self._skin, outwards)[..., 0]
        return np.where(self._hits.hit, found, 0.0)

    def _along_u(self, vertices_mm: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Unit tangents (V', 3) along increasing u."""
        corners, uv = vertices_mm[self._triangles], self.uv[self._triangles]
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        grows = (one * b[:, 1:] - two * a[:, 1:]) * np.sign(area)[:, None]
        total = incidence(self._triangles, len(vertices_mm)) @ grows
        return normalised(total - (total * normals).sum(axis=1, keepdims=True) * normals)
