"""What the cameras measure of a mesh's motion, and the robust solve that joins them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.multiview.pairs import density
from vermilion.multiview.photometric import Sight, sight
from vermilion.multiview.solver import DisplacementSolver, ThinPlate
from vermilion.multiview.stereo import Cloud
from vermilion.multiview.views import Frame


@dataclass(frozen=True)
class ReferenceFrame:
    """A frame whose mesh is known, and what its cameras see of it.

    Attributes:
        frame: its images.
        vertices_mm: (V, 3).
        triangles: (T, 3).
        sights: camera name -> Sight.
        plate: shape prior with the neutral as rest.
        px_per_mm: of the full-size cameras, median; brings pixels and millimetres together.
    """

    frame: Frame
    vertices_mm: np.ndarray
    triangles: np.ndarray
    sights: dict[str, Sight]
    plate: ThinPlate
    px_per_mm: float

    @classmethod
    def of(
        cls,
        frame: Frame,
        vertices_mm: np.ndarray,
        triangles: np.ndarray,
        plate: ThinPlate | None = None,
    ) -> ReferenceFrame:
        """Of a frame and its mesh.

        Args:
            frame: with its images.
            vertices_mm: (V, 3) world, mm.
            triangles: (T, 3).
            plate: of the neutral; None: the mesh is the neutral.
        """
        vertices_mm = np.asarray(vertices_mm, dtype=np.float64)
        plate = ThinPlate.of(vertices_mm, triangles) if plate is None else plate
        sights = see_all(frame, vertices_mm, triangles)
        centre = vertices_mm.mean(axis=0)
        densities = [density(view.camera, centre) for view in frame.views.values()]
        return cls(frame, vertices_mm, triangles, sights, plate, float(np.median(densities)))


def see_all(frame: Frame, vertices_mm: np.ndarray, triangles: np.ndarray) -> dict[str, Sight]:
    """What every camera of a frame sees of a mesh, vertices_mm (V, 3) world, triangles (T, 3)."""
    caster = RayCaster(vertices_mm, triangles)
    normals = vertex_normals(vertices_mm, triangles)
    return {
        name: sight(caster, view.camera, vertices_mm, normals) for name, view in frame.views.items()
    }


@dataclass(frozen=True)
class Measurements:
    """Linearised reprojection: `jacobians @ step` should be `offsets_px`.

    Attributes:
        jacobians: (C, V, 2, 3) px/mm.
        offsets_px: (C, V, 2).
        weights: (C, V) in [0, 1].
    """

    jacobians: np.ndarray
    offsets_px: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class CloudData:
    """Stereo points of a frame that may pull at its mesh.

    Attributes:
        cloud: near the mesh, world.
        allowed: (V,) bool, vertices that it may pull.
        gate_mm: how near the points of a vertex lie.
    """

    cloud: Cloud
    allowed: np.ndarray
    gate_mm: float


@dataclass(frozen=True)
class PlaneData:
    """Point-to-plane data: `normals @ step` should be `heights_mm`.

    Attributes:
        normals: (V, 3).
        heights_mm: (V,).
        weights: (V,) against 1 for a pixel row of the median camera.
    """

    normals: np.ndarray
    heights_mm: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class SolveSettings:
    """How a step is solved for.

    Attributes:
        length_mm: stiffness (see `solver`).
        px_per_mm: of the median camera; a row of it weighs one.
        sigma_px: expected error of a measurement.
        max_step_mm: longest step of a vertex.
        keep_shape: pull towards the shape at rest; else only the step is smooth.
        rounds: of re-weighting.
        tolerance: of the solver.
    """

    length_mm: float
    px_per_mm: float
    sigma_px: float
    max_step_mm: float
    keep_shape: bool = True
    rounds: int = 3
    tolerance: float = 1e-4


@dataclass(frozen=True)
class Solution:
    """A step and how well it explains the measurements.

    Attributes:
        step_mm: (V, 3).
        weights: (C, V) after robust re-weighting.
        left_px: (C, V) what the step does not explain.
    """

    step_mm: np.ndarray
    weights: np.ndarray
    left_px: np.ndarray


def solve_motion(
    plate: ThinPlate,
    current_mm: np.ndarray,
    measured: Measurements,
    settings: SolveSettings,
    planes: PlaneData | None = None,
) -> Solution:
    """Step of all vertices by iteratively re-weighted least squares (Cauchy weights).

    Args:
        plate: the prior.
        current_mm: (V, 3) the mesh now, world, mm.
        measured: of C cameras at its vertices.
        settings: stiffness, weights and rounds.
        planes: further data, for instance of the frame's point cloud.

    Returns:
        the step (V, 3) and how well it explains the measurements.
    """
    missing = plate.missing(current_mm) if settings.keep_shape else None
    solver: DisplacementSolver | None = None
    step: np.ndarray | None = None
    robust = measured.weights
    jacobians = measured.jacobians / settings.px_per_mm
    offsets = measured.offsets_px / settings.px_per_mm
    for _ in range(settings.rounds):
        weighted = (jacobians * robust[..., None, None]).transpose(1, 3, 0, 2)
        flat = jacobians.transpose(1, 0, 2, 3)
        n = len(current_mm)
        weighted, flat = weighted.reshape(n, 3, -1), flat.reshape(n, -1, 3)
        blocks = weighted @ flat
        right = (weighted @ offsets.transpose(1, 0, 2).reshape(n, -1, 1))[:, :, 0]
        if planes is not None:
            outer = planes.normals[:, :, None] * planes.normals[:, None, :]
            blocks = blocks + planes.weights[:, None, None] * outer
            right = right + (planes.weights * planes.heights_mm)[:, None] * planes.normals
        if solver is None:
            solver = DisplacementSolver(
                plate, blocks, settings.length_mm, tolerance=settings.tolerance
            )
        step = solver.solve(blocks, right, missing, step)
        explained = (flat @ step[:, :, None]).reshape(n, -1, 2).transpose(1, 0, 2)
        left = np.linalg.norm(explained - offsets, axis=2) * settings.px_per_mm
        robust = measured.weights / (1 + (left / (3 * settings.sigma_px)) ** 2)
    assert step is not None  # there is a round
    length = np.linalg.norm(step, axis=1, keepdims=True)
    step = step * np.minimum(1.0, settings.max_step_mm / np.maximum(length, 1e-12))
    return Solution(step, robust, left)


def cloud_planes(
    vertices_mm: np.ndarray,
    normals: np.ndarray,
    data: CloudData,
    sigma_mm: float,
    neighbours: int = 8,
) -> PlaneData:
    """Heights of a frame's stereo points over the mesh, at the vertices.

    Each vertex takes the median of its nearest points that lie within the gate.

    Args:
        vertices_mm: (V, 3) world, mm.
        normals: (V, 3) unit.
        data: the points, and the vertices that they may pull.
        sigma_mm: the error of a point that weighs one.
        neighbours: points of a vertex; with fewer than half of them it has no height.

    Returns:
        heights (V,) mm along the normals, weight 0 where there is none.
    """
    cloud = data.cloud
    n = len(vertices_mm)
    heights, weights = np.zeros(n), np.zeros(n)
    if len(cloud) < neighbours:
        return PlaneData(normals, heights, weights)
    ids = np.flatnonzero(data.allowed)
    distance, near = cKDTree(cloud.points_mm).query(
        vertices_mm[ids], k=neighbours, distance_upper_bound=data.gate_mm
    )
    found = np.isfinite(distance)
    near = np.where(found, near, 0)
    offset = cloud.points_mm[near] - vertices_mm[ids, None]
    height = np.einsum("nkj,nj->nk", offset, normals[ids])
    height = np.where(found, height, np.nan)
    enough = found.sum(axis=1) >= neighbours // 2
    ids, height, near = ids[enough], height[enough], near[enough]
    if len(ids):
        heights[ids] = np.nanmedian(height, axis=1)
        weights[ids] = (sigma_mm / np.median(cloud.sigma_mm[near], axis=1)) ** 2
    return PlaneData(normals, heights, weights)
