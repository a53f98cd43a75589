"""Laplacian registration of the coarse neutral onto the accurate one (Lips16 4.1).

The coarse mesh moves by a displacement d that minimises its bending and its distance to targets,

    integral |Laplace d|^2 dA  +  sum_k w_k |B_k d - r_k|^2,

first with the landmarks alone as targets, then with landmarks and closest points in turn, the wavelength
under which differences are smoothed away growing shorter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from vermilion.geometry.mesh import Mesh, boundary_edges, vertex_areas, vertex_normals
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.geometry.surface_points import SurfaceMap, closest_on_surface


def similarity_alignment(
    source: np.ndarray, target: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Scale, rotation (3, 3), translation (3,): target ~ scale * source @ R.T + t (Umeyama 1991)."""
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    source_c, target_c = source - source_mean, target - target_mean
    u, singular, vt = np.linalg.svd(target_c.T @ source_c)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * signs) @ vt
    scale = float((singular * signs).sum() / (source_c**2).sum())
    return scale, rotation, target_mean - scale * rotation @ source_mean


class BendingDeformer:
    """Deforms a mesh towards targets with the least bending; keeps the bending matrix."""

    def __init__(self, mesh: Mesh):
        self.mesh = mesh
        laplacian, mass = cotangent_laplacian(mesh.vertices_mm, mesh.triangles)
        area = mass.diagonal()
        floor = 1e-6 * area.max()  # vertices that no triangle has
        inverse = sparse.diags_array(1.0 / np.maximum(area, floor))
        self._bending = laplacian @ inverse @ laplacian
        # A trace of stiffness against nothing at all keeps loose parts in place.
        self._anchor = sparse.diags_array(1e-9 * np.maximum(area, floor))

    def displacement(
        self, sampling: sparse.spmatrix, residuals: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """d (V, 3) for B d ~ r: sampling (N, V), residuals (N, 3), weights (N,)."""
        weighted = sparse.diags_array(weights) @ sampling
        matrix = self._bending + self._anchor + sampling.T @ weighted
        return CholeskyFactor(sparse.csc_matrix(matrix)).solve(weighted.T @ residuals)


def register(
    coarse: Mesh,
    accurate: Mesh,
    landmarks_coarse: SurfaceMap,
    landmarks_accurate: SurfaceMap,
    *,
    sides_coarse: np.ndarray | None = None,
    sides_accurate: np.ndarray | None = None,
    landmark_weight: float = 0.3,
    wavelengths_mm: Sequence[float] = (100.0, 60.0, 40.0, 25.0, 15.0, 15.0),
    search_distance_mm: float = 25.0,
    max_angle_deg: float = 70.0,
) -> Mesh:
    """The coarse mesh laid over the accurate one, in the accurate one's frame.

    Args:
        coarse, accurate: neutral meshes; their frames need not agree.
        landmarks_coarse, landmarks_accurate: the same N landmarks on both; pairs with an unbound
            end are left out.
        sides_coarse, sides_accurate: (V,) in -1, 0, 1: lower lip, neither, upper lip.
        landmark_weight: weight of a landmark beside bending (1 / mm^2).
        wavelengths_mm: one dense step each; differences of a shorter wavelength are smoothed.
        search_distance_mm: farther closest points are no targets.
        max_angle_deg: between the normals of a vertex and its target.

    Raises:
        ValueError: fewer than six landmark pairs.
    """
    pairs = landmarks_coarse.bound & landmarks_accurate.bound
    if pairs.sum() < 6:
        raise ValueError(f"registration needs at least 6 landmark pairs, got {int(pairs.sum())}")
    sampling = landmarks_coarse.matrix(coarse.triangles, len(coarse.vertices_mm))[pairs]
    wanted = landmarks_accurate.sample(accurate.vertices_mm, accurate.triangles)[pairs]
    scale, rotation, translation = similarity_alignment(sampling @ coarse.vertices_mm, wanted)
    placed = coarse.with_vertices(scale * coarse.vertices_mm @ rotation.T + translation)
    deformer = BendingDeformer(placed)
    landmark_weights = np.full(len(wanted), landmark_weight)
    residuals = wanted - sampling @ placed.vertices_mm
    vertices = placed.vertices_mm + deformer.displacement(sampling, residuals, landmark_weights)

    areas = vertex_areas(placed.vertices_mm, placed.triangles)
    triangle_sides = (
        None if sides_accurate is None else sides_of_triangles(accurate, sides_accurate)
    )
    for wavelength in wavelengths_mm:
        targets, distance = closest_on_surface(
            vertices,
            accurate,
            normals=vertex_normals(vertices, coarse.triangles),
            max_angle_deg=max_angle_deg,
            sides=sides_coarse,
            triangle_sides=triangle_sides,
        )
        used = targets.bound & (distance < search_distance_mm) & ~_on_border(targets, accurate)
        found = targets.sample(accurate.vertices_mm, accurate.triangles)
        residuals = np.where(used[:, None], found - placed.vertices_mm, 0.0)
        # Landmarks guide the first steps and fade: the surfaces say more than single pixels.
        share = min(1.0, (wavelength / wavelengths_mm[0]) ** 2)
        stacked = sparse.vstack([sparse.identity(len(vertices), format="csr"), sampling])
        vertices = placed.vertices_mm + deformer.displacement(
            stacked,
            np.concatenate([residuals, wanted - sampling @ placed.vertices_mm]),
            np.concatenate(
                [areas * used * (2 * np.pi / wavelength) ** 4, share * landmark_weights]
            ),
        )
    return placed.with_vertices(vertices)


def sides_of_triangles(mesh: Mesh, sides: np.ndarray) -> np.ndarray:
    """Side of each triangle: that of its corners where they agree, else 0, (T,)."""
    return np.sign(sides[mesh.triangles].sum(axis=1)).astype(np.int8)


def _on_border(points: SurfaceMap, mesh: Mesh) -> np.ndarray:
    """Points on the mesh's border: the closest of a surface that goes on beyond it, so no match."""
    border = np.zeros(len(mesh.vertices_mm), dtype=bool)
    border[boundary_edges(mesh.triangles)] = True
    corners = mesh.triangles[np.maximum(points.triangle, 0)]
    off_border = (points.barycentric * ~border[corners]).sum(axis=1)
    return off_border < 1e-6
