"""The correspondence of a person: coarse vertices and triangles on the accurate mesh, and the mask."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from vermilion.correspondence.binding import bind_vertices, flipped_triangles
from vermilion.correspondence.lip_sides import lip_sides
from vermilion.geometry.mesh import Mesh, topology_hash, triangle_normals
from vermilion.geometry.registration import register, sides_of_triangles
from vermilion.geometry.surface_points import SurfaceMap, closest_on_surface
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Correspondence:
    """Coarse mesh **C** against accurate mesh **H**, found on the neutral, valid for every frame.

    Attributes:
        vertices: C vertex -> point of H, (V,); unbound where H is absent.
        triangles: (T,) int32 C triangle -> H triangle, -1 where H is absent.
        distance_mm: (V,) between the registered C vertex and its point of H; infinite if unbound.
        mask: (M,) int32 ids of the C triangles of the correction layer.
        rigid: (V,) bool, bound C vertices outside the mask by which heads are aligned.
        accurate_triangles: (T_H, 3) int32 topology of H.
        coarse_triangles: (T, 3) int32 topology of C.
        coarse_neutral_mm: (V, 3) C at the neutral, in its head frame.
    """

    vertices: SurfaceMap
    triangles: np.ndarray
    distance_mm: np.ndarray
    mask: np.ndarray
    rigid: np.ndarray
    accurate_triangles: np.ndarray
    coarse_triangles: np.ndarray
    coarse_neutral_mm: np.ndarray

    @property
    def topology(self) -> str:
        """Hash of C's topology; layers and regressors of another one do not fit."""
        return topology_hash(self.coarse_triangles)

    def on_coarse(self, accurate_mm: np.ndarray) -> np.ndarray:
        """H on the topology of C: (..., V_H, 3) -> (..., V, 3) float64, NaN where H is absent."""
        return self.vertices.sample(accurate_mm, self.accurate_triangles)

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(
            path,
            compressed=True,
            format_version=FORMAT_VERSION,
            vertex_triangle=self.vertices.triangle.astype(np.int32),
            vertex_barycentric=self.vertices.barycentric.astype(np.float64),
            triangle_triangle=self.triangles.astype(np.int32),
            distance_mm=self.distance_mm.astype(np.float32),
            mask=self.mask.astype(np.int32),
            rigid=self.rigid,
            accurate_triangles=self.accurate_triangles.astype(np.int32),
            coarse_triangles=self.coarse_triangles.astype(np.int32),
            coarse_neutral_mm=self.coarse_neutral_mm.astype(np.float64),
        )

    @classmethod
    def load(cls, path: str | Path) -> Correspondence:
        """Read what `save` wrote. Raises InputError on a damaged file or another format."""
        arrays = read_arrays(path, "correspondence")
        version = int(arrays.get("format_version", -1))
        if version != FORMAT_VERSION:
            raise InputError(
                f"correspondence format {version}",
                f"format {FORMAT_VERSION}",
                "Remove the file and run again.",
                path=path,
            )
        return cls(
            vertices=SurfaceMap(arrays["vertex_triangle"], arrays["vertex_barycentric"]),
            triangles=arrays["triangle_triangle"],
            distance_mm=arrays["distance_mm"],
            mask=arrays["mask"],
            rigid=arrays["rigid"],
            accurate_triangles=arrays["accurate_triangles"],
            coarse_triangles=arrays["coarse_triangles"],
            coarse_neutral_mm=arrays["coarse_neutral_mm"],
        )


def find_correspondence(
    coarse: Mesh,
    accurate: Mesh,
    landmarks_coarse: SurfaceMap,
    landmarks_accurate: SurfaceMap,
    mouth_centre_mm: np.ndarray,
    eyelids_mm: np.ndarray,
    *,
    coarse_regions: Mapping[str, np.ndarray] | None = None,
    accurate_regions: Mapping[str, np.ndarray] | None = None,
    mask_radius_mm: float = 95.0,
    eye_gap_mm: float = 10.0,
    max_distance_mm: float = 4.0,
    max_angle_deg: float = 70.0,
    **registration,
) -> tuple[Correspondence, Mesh]:
    """Register the neutrals and bind every coarse vertex and triangle to the accurate mesh.

    Any coarse mesh will do, from this tracker or another; regions help where they are known.

    Args:
        coarse: C at the neutral, in its head frame.
        accurate: H at the neutral, in any frame.
        landmarks_coarse, landmarks_accurate: the same landmarks on both meshes.
        mouth_centre_mm: (3,) in C's frame.
        eyelids_mm: (N, 3) points in C's frame from which the mask keeps away; there may be none.
        coarse_regions, accurate_regions: regions of `FaceModel`, or None for another tracker's mesh.
        mask_radius_mm: the mask's reach from the mouth's centre.
        eye_gap_mm: the mask's distance from points of the eyelids.
        max_distance_mm: between a registered vertex and its point of H.
        registration: further settings of `register`.

    Returns:
        (the correspondence, C registered over H).
    """
    sides_coarse = None if coarse_regions is None else lip_sides(coarse, coarse_regions)
    sides_accurate = None if accurate_regions is None else lip_sides(accurate, accurate_regions)
    registered = register(
        coarse,
        accurate,
        landmarks_coarse,
        landmarks_accurate,
        sides_coarse=sides_coarse,
        sides_accurate=sides_accurate,
        max_angle_deg=max_angle_deg,
        **registration,
    )
    triangle_sides = (
        None if sides_accurate is None else sides_of_triangles(accurate, sides_accurate)
    )
    search = {"max_angle_deg": max_angle_deg, "triangle_sides": triangle_sides}
    vertices, distance = bind_vertices(
        registered, accurate, max_distance_mm=max_distance_mm, sides=sides_coarse, **search
    )
    bound_mm = vertices.sample(accurate.vertices_mm, accurate.triangles)
    whole = vertices.bound[coarse.triangles].all(axis=1)
    bound = Mesh(np.nan_to_num(bound_mm), coarse.triangles)
    triangles, _ = closest_on_surface(
        bound.vertices_mm[coarse.triangles].mean(axis=1),
        accurate,
        normals=triangle_normals(bound.vertices_mm, coarse.triangles),
        sides=None if sides_coarse is None else sides_of_triangles(coarse, sides_coarse),
        **search,
    )
    matched = (
        whole & (triangles.triangle >= 0) & ~flipped_triangles(vertices, coarse.triangles, accurate)
    )
    mask = mouth_mask(
        coarse, mouth_centre_mm, mask_radius_mm, eyelids_mm, eye_gap_mm, matched, coarse_regions
    )
    in_mask = np.zeros(len(distance), dtype=bool)
    in_mask[coarse.triangles[mask]] = True
    rest = vertices.bound & ~in_mask
    if coarse_regions is not None and (rest & coarse_regions["rigid"]).sum() >= 30:
        rest = rest & coarse_regions["rigid"]
    correspondence = Correspondence(
        vertices=vertices,
        triangles=np.where(whole, triangles.triangle, -1),
        distance_mm=distance,
        mask=mask,
        rigid=rest,
        accurate_triangles=accurate.triangles,
        coarse_triangles=coarse.triangles,
        coarse_neutral_mm=coarse.vertices_mm,
    )
    return correspondence, registered


def mouth_mask(
    coarse: Mesh,
    mouth_centre_mm: np.ndarray,
    radius_mm: float,
    eyelids_mm: np.ndarray,
    eye_gap_mm: float,
    matched: np.ndarray,
    regions: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """Ids of the matched triangles within `radius_mm` of the mouth's centre, in one piece.

    Args:
        eyelids_mm, eye_gap_mm: no vertex lies as near to one of these points (N, 3).
        matched: (T,) bool, triangles whose corners are bound.
        regions: with them, the inside of the mouth, teeth and eyes are left out.
    """
    near = np.linalg.norm(coarse.vertices_mm - mouth_centre_mm, axis=1) <= radius_mm
    if len(eyelids_mm):
        near &= cKDTree(eyelids_mm).query(coarse.vertices_mm)[0] > eye_gap_mm
    if regions is not None:
        near &= ~(regions["mouth_inner"] | regions["teeth"] | regions["eyes"])
    inside = np.flatnonzero(near[coarse.triangles].all(axis=1) & matched)
    if not len(inside):
        raise ValueError(
            f"no triangle of the coarse mesh within {radius_mm} mm of the mouth is matched"
        )
    corners = coarse.triangles[inside]
    rows, columns = corners[:, [0, 1, 2]].ravel(), corners[:, [1, 2, 0]].ravel()
    n_vertices = len(coarse.vertices_mm)
    graph = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(n_vertices,) * 2)
    _, part = csgraph.connected_components(graph, directed=False)
    part = part[corners[:, 0]]
    return inside[part == np.bincount(part).argmax()].astype(np.int32)
