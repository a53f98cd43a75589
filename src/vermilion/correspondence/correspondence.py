"""The correspondence of a person: coarse vertices and triangles on the accurate mesh, and the mask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from vermilion.correspondence.binding import bind_vertices, flipped_triangles
from vermilion.faces.lips import lip_sides_by_distance, triangle_sides
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, connected_parts, triangle_normals, unique_edges
from vermilion.geometry.registration import LandmarkTargets, Schedule, register
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.storage.arrays import read_arrays, write_arrays

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Correspondence:
    """Coarse mesh **C** against accurate mesh **H**, found on the neutral, valid for every frame.

    Attributes:
        vertices: C vertex -> point of H, (V,); unbound where H is absent.
        triangles: (T,) int32 C triangle -> H triangle, -1 where H is absent.
        mask: (M,) int32 ids of the C triangles of the correction layer.
        rigid: (V,) bool, bound C vertices outside the mask by which heads are aligned.
        accurate_triangles: (T_H, 3) int32 topology of H.
        coarse_triangles: (T, 3) int32 topology of C.
        coarse_neutral_mm: (V, 3) C at the neutral, in its head frame.
    """

    vertices: SurfacePoints
    triangles: np.ndarray
    mask: np.ndarray
    rigid: np.ndarray
    accurate_triangles: np.ndarray
    coarse_triangles: np.ndarray
    coarse_neutral_mm: np.ndarray

    @property
    def distance_mm(self) -> np.ndarray:
        """(V,) between the registered C vertex and its point of H; infinite if unbound."""
        return np.asarray(self.vertices.distance_mm)

    def on_coarse(self, accurate_mm: np.ndarray) -> np.ndarray:
        """H on the topology of C.

        Args:
            accurate_mm: (..., V_H, 3) in any frame, mm.

        Returns:
            (..., V, 3) float64 in that frame; NaN where H is absent.
        """
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
        arrays = read_arrays(path, "correspondence", version=FORMAT_VERSION)
        names = ("mask", "rigid", "accurate_triangles", "coarse_triangles", "coarse_neutral_mm")
        return cls(
            SurfacePoints(
                arrays["vertex_triangle"], arrays["vertex_barycentric"], arrays["distance_mm"]
            ),
            arrays["triangle_triangle"],
            **{name: arrays[name] for name in names},
        )


@dataclass(frozen=True)
class CorrespondenceSettings:
    """See `vermilion.config.correspondence` for meanings and units."""

    landmark_weight: float
    wavelengths_mm: Sequence[float]
    search_distance_mm: float
    max_distance_mm: float
    max_angle_deg: float
    mask_radius_mm: float
    eye_gap_mm: float


@dataclass(frozen=True)
class MarkedMesh:
    """A neutral and what is known of it.

    Attributes:
        mesh: V vertices, mm.
        landmarks: N landmarks, the same ones for both meshes; unbound where unknown.
        regions: names of `FaceModel.regions` -> (V,) bool; None for another tracker's mesh.
    """

    mesh: Mesh
    landmarks: SurfacePoints
    regions: Mapping[str, np.ndarray] | None = None

    @property
    def sides(self) -> np.ndarray | None:
        """(V,) lip of each vertex, +1 upper, -1 lower, 0 neither; None without regions."""
        return None if self.regions is None else lip_sides_by_distance(self.mesh, self.regions)

    @property
    def triangle_sides(self) -> np.ndarray | None:
        """(T,) lip of each triangle, likewise."""
        sides = self.sides
        return None if sides is None else triangle_sides(self.mesh.triangles, sides)


def find_correspondence(
    coarse: MarkedMesh,
    accurate: MarkedMesh,
    mouth_centre_mm: np.ndarray,
    eyelids_mm: np.ndarray,
    settings: CorrespondenceSettings,
) -> tuple[Correspondence, Mesh]:
    """Register the neutrals and bind every coarse vertex and triangle to the accurate mesh.

    Any coarse mesh will do, from this tracker or another; regions help where they are known.

    Args:
        coarse: C at the neutral, in its head frame.
        accurate: H at the neutral, in any frame.
        mouth_centre_mm: (3,) in C's frame.
        eyelids_mm: (N, 3) points in C's frame from which the mask keeps away; there may be none.
        settings: of registration, binding and mask.

    Returns:
        the correspondence, and C registered over H, in H's frame.

    Raises:
        ValueError: fewer than six landmark pairs, or no matched triangle near the mouth.
    """
    triangles = coarse.mesh.triangles
    registered = register_coarse_neutral(coarse, accurate, settings)
    vertices = bind_vertices(
        registered,
        accurate.mesh,
        max_distance_mm=settings.max_distance_mm,
        max_angle_deg=settings.max_angle_deg,
        sides=coarse.sides,
        triangle_sides=accurate.triangle_sides,
    )
    owner = _triangles_of(vertices, coarse, accurate, settings.max_angle_deg)
    flipped = flipped_triangles(vertices, triangles, accurate.mesh)
    mask = mouth_mask(coarse, mouth_centre_mm, eyelids_mm, (owner >= 0) & ~flipped, settings)
    rest = vertices.bound.copy()
    rest[triangles[mask]] = False
    if coarse.regions is not None and (rest & coarse.regions["rigid"]).sum() >= 30:
        rest = rest & coarse.regions["rigid"]
    correspondence = Correspondence(
        vertices=vertices,
        triangles=owner,
        mask=mask,
        rigid=rest,
        accurate_triangles=accurate.mesh.triangles,
        coarse_triangles=triangles,
        coarse_neutral_mm=coarse.mesh.vertices_mm,
    )
    return correspondence, registered


def register_coarse_neutral(
    coarse: MarkedMesh, accurate: MarkedMesh, settings: CorrespondenceSettings
) -> Mesh:
    """The coarse neutral laid over the accurate one, in the accurate one's frame, mm.

    Landmark pairs with an unbound end are left out; the frames of the two need not agree.

    Raises:
        ValueError: fewer than six landmark pairs.
    """
    pairs = coarse.landmarks.bound & accurate.landmarks.bound
    if pairs.sum() < 6:
        raise ValueError(f"registration needs at least 6 landmark pairs, got {int(pairs.sum())}")
    source, wanted = (
        marked.landmarks[pairs].sample(marked.mesh.vertices_mm, marked.mesh.triangles)
        for marked in (coarse, accurate)
    )
    placed = similarity_alignment(source, wanted).apply(coarse.mesh.vertices_mm)
    weights = np.full(len(wanted), settings.landmark_weight)
    registered, _ = register(
        coarse.mesh.with_vertices(placed),
        accurate.mesh,
        LandmarkTargets(coarse.landmarks[pairs], wanted, weights),
        Schedule(settings.wavelengths_mm, settings.search_distance_mm, settings.max_angle_deg),
        sides=coarse.sides,
        triangle_sides=accurate.triangle_sides,
    )
    return registered


def _triangles_of(
    vertices: SurfacePoints, coarse: MarkedMesh, accurate: MarkedMesh, max_angle_deg: float
) -> np.ndarray:
    """H's triangle at the middle of each C triangle, (T,); -1 where a corner is unbound."""
    mesh, triangles = accurate.mesh, coarse.mesh.triangles
    bound_mm = np.nan_to_num(vertices.sample(mesh.vertices_mm, mesh.triangles))
    found = Surface(mesh.vertices_mm, mesh.triangles).closest(
        bound_mm[triangles].mean(axis=1),
        triangle_normals(bound_mm, triangles),
        np.cos(np.deg2rad(max_angle_deg)),
        coarse.triangle_sides,
        accurate.triangle_sides,
    )
    return np.where(vertices.bound[triangles].all(axis=1), found.triangle, -1)


def mouth_mask(
    coarse: MarkedMesh,
    mouth_centre_mm: np.ndarray,
    eyelids_mm: np.ndarray,
    matched: np.ndarray,
    settings: CorrespondenceSettings,
) -> np.ndarray:
    """The matched triangles within `mask_radius_mm` of the mouth's centre, in one piece.

    Args:
        coarse: T triangles; with regions, the inside of the mouth, teeth and eyes are left out.
        mouth_centre_mm: (3,) in the mesh's frame.
        eyelids_mm: (N, 3) in the mesh's frame; no vertex of the mask lies within `eye_gap_mm`.
        matched: (T,) bool, triangles that may belong to the mask.
        settings: `mask_radius_mm` and `eye_gap_mm`.

    Returns:
        (M,) int32 triangle ids, ascending.

    Raises:
        ValueError: there is no such triangle.
    """
    vertices, triangles = coarse.mesh.vertices_mm, coarse.mesh.triangles
    near = np.linalg.norm(vertices - mouth_centre_mm, axis=1) <= settings.mask_radius_mm
    if len(eyelids_mm):
        near &= cKDTree(eyelids_mm).query(vertices)[0] > settings.eye_gap_mm
    if coarse.regions is not None:
        regions = coarse.regions
        near &= ~(regions["mouth_inner"] | regions["teeth"] | regions["eyes"])
    inside = np.flatnonzero(near[triangles].all(axis=1) & matched)
    if not len(inside):
        raise ValueError(
            f"no triangle of the coarse mesh within {settings.mask_radius_mm} mm of the mouth is "
            "matched"
        )
    corners = triangles[inside]
    part = connected_parts(unique_edges(corners), len(vertices))[corners[:, 0]]
    return inside[part == np.bincount(part).argmax()].astype(np.int32)
