"""The posed model laid over a scan: landmarks, dense search, Laplacian deformation (Mono13 4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from vermilion.geometry.mesh import Mesh, boundary_edges, vertex_areas, vertex_normals
from vermilion.geometry.registration import BendingDeformer
from vermilion.geometry.surface_points import closest_on_surface

#: Wavelengths under which differences are smoothed away; one dense search each.
WAVELENGTHS_MM = (80.0, 50.0, 30.0, 20.0, 12.0, 8.0, 5.0, 4.0, 4.0)


def register_scan(
    posed: Mesh,
    scan: Mesh,
    landmark_vertices: np.ndarray,
    landmarks_mm: np.ndarray,
    landmark_sigma_mm: np.ndarray,
    searching: np.ndarray,
    *,
    wavelengths_mm: Sequence[float] = WAVELENGTHS_MM,
    search_distance_mm: float = 20.0,
    max_angle_deg: float = 60.0,
) -> tuple[Mesh, np.ndarray]:
    """Deform a mesh onto a scan with the least bending.

    Args:
        posed: the fitted model, head frame.
        scan: in the head frame, mm.
        landmark_vertices: (L,) of the mesh.
        landmarks_mm: (L, 3) where they lie on the scan; NaN where unknown.
        landmark_sigma_mm: (L,) their deviations.
        searching: (V,) bool, vertices that look for the scan; the others (the inside of the mouth)
            go with them.
        wavelengths_mm: see `WAVELENGTHS_MM`.
        search_distance_mm: of the first search; it narrows with the wavelength to a quarter.
        max_angle_deg: between the normals of a vertex and its target.

    Returns:
        (registered mesh, (V,) bool of the vertices that met the scan in the end).
    """
    known = np.isfinite(landmarks_mm).all(axis=1)
    rows = np.arange(int(known.sum()))
    n_vertices = len(posed.vertices_mm)
    pick = sparse.csr_matrix(
        (np.ones(len(rows)), (rows, landmark_vertices[known])), shape=(len(rows), n_vertices)
    )
    wanted = landmarks_mm[known] - posed.vertices_mm[landmark_vertices[known]]
    trust = 1.0 / landmark_sigma_mm[known] ** 2
    deformer = BendingDeformer(posed)
    vertices = posed.vertices_mm + deformer.displacement(pick, wanted, trust)
    areas = vertex_areas(posed.vertices_mm, posed.triangles) * searching
    border = np.zeros(len(scan.vertices_mm), dtype=bool)
    border[boundary_edges(scan.triangles)] = True
    both = sparse.vstack([sparse.identity(n_vertices, format="csr"), pick])
    used = searching
    for wavelength in wavelengths_mm:
        share = (wavelength / wavelengths_mm[0]) ** 2
        targets, distance = closest_on_surface(
            vertices,
            scan,
            normals=vertex_normals(vertices, posed.triangles),
            max_angle_deg=max_angle_deg,
        )
        on_border = (targets.barycentric * ~border[scan.triangles[targets.triangle]]).sum(1) < 1e-6
        reach = search_distance_mm * max(np.sqrt(share), 0.25)
        used = searching & targets.bound & (distance < reach) & ~on_border
        found = targets.sample(scan.vertices_mm, scan.triangles)
        residuals = np.where(used[:, None], found - posed.vertices_mm, 0.0)
        weights = areas * used * (2 * np.pi / wavelength) ** 4
        # Landmarks guide the first steps and fade: surfaces say more than single pixels.
        vertices = posed.vertices_mm + deformer.displacement(
            both, np.concatenate([residuals, wanted]), np.concatenate([weights, share * trust])
        )
    return posed.with_vertices(vertices), used
