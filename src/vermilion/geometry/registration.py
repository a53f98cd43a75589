"""Laplacian registration of one mesh onto another surface (Lips16 4.1, Mono13 4).

The mesh moves by a displacement d that minimises its bending and its distance to targets,

    integral |Laplace d|^2 dA  +  sum_k w_k |B_k d - r_k|^2,

first with the landmarks alone as targets, then with landmarks and closest points in turn, the wavelength
under which differences are smoothed away growing shorter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, boundary_edges, vertex_areas, vertex_normals
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.geometry.surface_points import SurfacePoints


@dataclass(frozen=True)
class LandmarkTargets:
    """Points of the moving mesh whose places on the other surface are known.

    Attributes:
        points: N points of the moving mesh, all bound.
        wanted_mm: (N, 3) their places, in the frame of the surface.
        weights: (N,) beside the bending, 1/mm^2.
    """

    points: SurfacePoints
    wanted_mm: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class Schedule:
    """The dense steps of a registration.

    Attributes:
        wavelengths_mm: one step each; differences of a shorter wavelength are smoothed away. The
            weight of the landmarks falls with the square of the wavelength.
        search_distance_mm: farther closest points are no targets.
        max_angle_deg: between the normals of a vertex and its target.
        narrowest: share of the search distance down to which it falls with the wavelength; 1: it
            stays.
    """

    wavelengths_mm: Sequence[float]
    search_distance_mm: float
    max_angle_deg: float
    narrowest: float = 1.0


class BendingDeformer:
    """Deforms a mesh towards targets with the least bending; keeps the bending matrix."""

    def __init__(self, mesh: Mesh):
        """Prepare a mesh of V vertices, mm."""
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
        """Solve B d ~ r in the least-squares sense, with the least bending.

        Args:
            sampling: (N, V) sparse B, which takes displacements of vertices to those of targets.
            residuals: (N, 3) r, mm.
            weights: (N,) 1/mm^2.

        Returns:
            (V, 3) displacements d, mm.
        """
        weighted = sparse.diags_array(weights) @ sampling
        matrix = self._bending + self._anchor + sampling.T @ weighted
        return CholeskyFactor(sparse.csc_matrix(matrix)).solve(weighted.T @ residuals)


def register(
    mesh: Mesh,
    onto: Mesh,
    landmarks: LandmarkTargets,
    schedule: Schedule,
    *,
    searching: np.ndarray | None = None,
    sides: np.ndarray | None = None,
    triangle_sides: np.ndarray | None = None,
) -> tuple[Mesh, np.ndarray]:
    """Deform a mesh onto a surface with the least bending.

    Args:
        mesh: V vertices, roughly in place, mm.
        onto: the surface, T triangles, in the same frame, mm.
        landmarks: guide the first steps and fade: surfaces say more than single points.
        schedule: of the dense steps.
        searching: (V,) bool, vertices that look for the surface, the others go with them; None: all.
        sides, triangle_sides: (V,) and (T,) lips, +1 upper, -1 lower, 0 neither: the one is never
            bound to the other.

    Returns:
        the registered mesh, and (V,) bool of the vertices that met the surface in the last step.
    """
    start = mesh.vertices_mm
    searching = np.ones(len(start), dtype=bool) if searching is None else searching
    sampling = landmarks.points.matrix(mesh.triangles, len(start))
    wanted = landmarks.wanted_mm - sampling @ start
    deformer = BendingDeformer(mesh)
    vertices = start + deformer.displacement(sampling, wanted, landmarks.weights)
    areas = vertex_areas(start, mesh.triangles) * searching
    both = sparse.vstack([sparse.identity(len(start), format="csr"), sampling])
    surface, met = Surface(onto.vertices_mm, onto.triangles), searching
    for wavelength in schedule.wavelengths_mm:
        relative = min(1.0, wavelength / schedule.wavelengths_mm[0])
        targets = surface.closest(
            vertices,
            vertex_normals(vertices, mesh.triangles),
            np.cos(np.deg2rad(schedule.max_angle_deg)),
            sides,
            triangle_sides,
        )
        assert targets.distance_mm is not None  # a search gives it
        reach = schedule.search_distance_mm * max(relative, schedule.narrowest)
        met = searching & (targets.distance_mm < reach) & ~_on_border(targets, onto)
        found = targets.sample(onto.vertices_mm, onto.triangles)
        residuals = np.where(met[:, None], found - start, 0.0)
        weights = areas * met * (2 * np.pi / wavelength) ** 4
        vertices = start + deformer.displacement(
            both,
            np.concatenate([residuals, wanted]),
            np.concatenate([weights, relative**2 * landmarks.weights]),
        )
    return mesh.with_vertices(vertices), met


def _on_border(points: SurfacePoints, mesh: Mesh) -> np.ndarray:
    """Points on the mesh's border: the closest of a surface that goes on beyond it, so no match."""
    border = np.zeros(len(mesh.vertices_mm), dtype=bool)
    border[boundary_edges(mesh.triangles)] = True
    return (points.barycentric * ~border[points.corners(mesh.triangles)]).sum(axis=1) < 1e-6
