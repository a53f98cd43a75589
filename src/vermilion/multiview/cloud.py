"""Fusing stereo points, gating them by a mesh, screened Poisson reconstruction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.cell_keys import cell_keys
from vermilion.geometry.mesh import Mesh, normalised, vertex_normals
from vermilion.multiview.stereo import Cloud
from vermilion.storage.files import atomic_path


def near_mesh(
    cloud: Cloud, mesh: Mesh, gate_mm: float, allowed: np.ndarray, min_cosine: float = 0.3
) -> Cloud:
    """Points within `gate_mm` of a mesh's allowed vertices, on its outside, normals alike.

    The background, teeth, tongue and gums lie behind or away from the skin; points whose nearest
    vertex is not allowed (the inside of the mouth) are dropped.

    Args:
        allowed: (V,) bool.
        min_cosine: smallest cosine between the normals of point and mesh.
    """
    normals = vertex_normals(mesh.vertices_mm, mesh.triangles)
    distance, nearest = cKDTree(mesh.vertices_mm).query(
        cloud.points_mm, distance_upper_bound=2.0 * gate_mm
    )
    found = np.isfinite(distance)
    nearest = np.where(found, nearest, 0)
    offset = cloud.points_mm - mesh.vertices_mm[nearest]
    height = (offset * normals[nearest]).sum(axis=1)
    alike = (cloud.normals * normals[nearest]).sum(axis=1) >= min_cosine
    return cloud.select(found & alike & (np.abs(height) <= gate_mm) & allowed[nearest])


def fuse(cloud: Cloud, spacing_mm: float, neighbours: int = 40, rounds: int = 2) -> Cloud:
    """One point a voxel, moved onto the weighted plane of its neighbours, with its normal.

    Moving least squares of order one (Alexa et al. 2003): neighbours weigh by 1 / sigma^2 and a
    Gaussian of `spacing_mm`; points that few neighbours support are dropped.
    """
    if len(cloud) < neighbours:
        return cloud
    cloud = thinned(cloud, spacing_mm / 2)  # so that the neighbours fill the Gaussian
    _, first = np.unique(_voxels(cloud, spacing_mm), return_index=True)
    seeds = cloud.select(np.sort(first))
    tree = cKDTree(cloud.points_mm)
    points, normals = seeds.points_mm, seeds.normals
    radius = 2.0 * spacing_mm
    for _ in range(rounds):
        distance, ids = tree.query(points, k=neighbours, distance_upper_bound=radius)
        found = np.isfinite(distance)
        ids = np.where(found, ids, 0)
        alike = np.einsum("nkj,nj->nk", cloud.normals[ids], normals) > 0.3
        weight = np.exp(-0.5 * (np.where(found, distance, radius) / spacing_mm) ** 2)
        weight = np.where(found & alike, weight / cloud.sigma_mm[ids] ** 2, 0)
        total = weight.sum(axis=1)
        supported = ((weight > 0).sum(axis=1) >= min(10, neighbours // 2)) & (total > 0)
        weight /= np.maximum(total, 1e-12)[:, None]
        mean = np.einsum("nk,nkj->nj", weight, cloud.points_mm[ids])
        spread = cloud.points_mm[ids] - mean[:, None]
        covariance = np.einsum("nk,nki,nkj->nij", weight, spread, spread)
        _, vectors = np.linalg.eigh(covariance)
        plane = vectors[:, :, 0]
        towards = np.einsum("nk,nkj->nj", weight, cloud.normals[ids])
        plane *= np.where((plane * towards).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        points = points + ((mean - points) * plane).sum(axis=1)[:, None] * plane
        points, normals, total = points[supported], plane[supported], total[supported]
    return Cloud(points, normals, 1.0 / np.sqrt(total))


def thinned(cloud: Cloud, spacing_mm: float) -> Cloud:
    """The mean point and normal of each voxel, weighted by 1 / sigma^2."""
    _, inverse = np.unique(_voxels(cloud, spacing_mm), return_inverse=True)
    weight = 1.0 / cloud.sigma_mm**2
    total = np.bincount(inverse, weight)

    def mean(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(inverse, weight * values[:, k]) for k in range(3)]
        return np.stack(sums, axis=1) / total[:, None]

    count = np.bincount(inverse)
    normals = normalised(mean(cloud.normals))
    # matched pixels share errors, so that a voxel is not surer by the root of its count
    return Cloud(mean(cloud.points_mm), normals, np.sqrt(count / total))


def _voxels(cloud: Cloud, spacing_mm: float) -> np.ndarray:
    """(N,) int64 key of the voxel in which each point of a cloud lies."""
    return cell_keys(np.floor(cloud.points_mm / spacing_mm).astype(np.int64))


def screened_poisson(cloud: Cloud, depth: int, trim_mm: float) -> Mesh:
    """Screened Poisson surface (Kazhdan and Hoppe 2013), without what lies far from any point."""
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=cloud.points_mm, v_normals_matrix=cloud.normals))
    meshes.generate_surface_reconstruction_screened_poisson(depth=depth, threads=1)
    surface = meshes.current_mesh()
    vertices, triangles = surface.vertex_matrix(), surface.face_matrix()
    distance, _ = cKDTree(cloud.points_mm).query(vertices)
    keep = (distance <= trim_mm)[triangles].all(axis=1)
    ids, inverse = np.unique(triangles[keep], return_inverse=True)
    return Mesh(vertices[ids], inverse.reshape(-1, 3).astype(np.int32))


def write_cloud(path: str | Path, cloud: Cloud) -> None:
    """Binary PLY with normals and `sigma_mm`."""
    names = ("x", "y", "z", "nx", "ny", "nz", "sigma_mm")
    header = ["ply", "format binary_little_endian 1.0", "comment unit millimetre"]
    header += [f"element vertex {len(cloud)}", *(f"property float {n}" for n in names)]
    header += ["end_header", ""]
    values = np.concatenate([cloud.points_mm, cloud.normals, cloud.sigma_mm[:, None]], axis=1)
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        stream.write("\n".join(header).encode("ascii"))
        stream.write(np.ascontiguousarray(values, dtype="<f4").tobytes())
