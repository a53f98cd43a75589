"""One frame registered directly to the reference frame's images: no drift, any order.

Each camera's image is predicted by carrying the reference image of the same camera through the
mesh; the flow to the real image gives every visible vertex a displacement in every camera that
sees it; a robust solve brings them together with the shape prior and the frame's stereo points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.multiview.motion import (
    CloudData,
    Measurements,
    ReferenceFrame,
    SolveSettings,
    cloud_planes,
    solve_motion,
)
from vermilion.multiview.photometric import FlowMatcher, measure_motion, rasterise, sight
from vermilion.multiview.views import Frame


@dataclass(frozen=True)
class Registered:
    """A frame's mesh and how well it is known.

    Attributes:
        vertices_mm: (V, 3).
        cameras_seeing: (V,) uint8, cameras with a usable measurement of the vertex; zero where
            the position comes from the shape prior alone.
        residual_px: (V,) weighted root mean square of what is left, NaN where not measured.
    """

    vertices_mm: np.ndarray
    cameras_seeing: np.ndarray
    residual_px: np.ndarray


@dataclass(frozen=True)
class FrameMatchSettings:
    """How a frame is matched.

    Attributes:
        sigma_px: expected error of a measurement.
        max_step_mm: longest step of a vertex in a round.
        min_agreement: correlation below which a measurement is not used.
        ray_stride_px: distance of the rays that predict an image.
    """

    sigma_px: float
    max_step_mm: float
    min_agreement: float
    ray_stride_px: int = 2


def register_frame(
    levels: Sequence[tuple[ReferenceFrame, Frame, float]],
    start_mm: np.ndarray,
    matcher: FlowMatcher,
    settings: FrameMatchSettings,
    cloud: CloudData | None = None,
) -> Registered:
    """Register a frame from a start within some pixels.

    Args:
        levels: the rounds: reference and frame at that round's resolution, and its stiffness in
            mm (see `solver`).
        start_mm: (V, 3) world, mm.
        matcher: of images.
        settings: see `FrameMatchSettings`.
        cloud: the frame's stereo points.

    Returns:
        the mesh in the world and how well it is known.
    """
    current = np.asarray(start_mm, dtype=np.float64)
    px_per_mm = levels[-1][0].px_per_mm
    for reference, frame, length in levels:
        measured, normals = measure_frame(reference, frame, current, matcher, settings)
        planes = None
        if cloud is not None:
            sigma_mm = settings.sigma_px / reference.px_per_mm
            planes = cloud_planes(current, normals, cloud, sigma_mm)
        solve = SolveSettings(length, px_per_mm, settings.sigma_px, settings.max_step_mm)
        solution = solve_motion(reference.plate, current, measured, solve, planes)
        current = current + solution.step_mm
    total = solution.weights.sum(axis=0)
    square = (solution.weights * solution.left_px**2).sum(axis=0)
    residual = np.where(total > 0, np.sqrt(square / np.maximum(total, 1e-9)), np.nan)
    seeing = (solution.weights > 0.05).sum(axis=0).astype(np.uint8)
    return Registered(current, seeing, residual)


def measure_frame(
    reference: ReferenceFrame,
    frame: Frame,
    vertices_mm: np.ndarray,
    matcher: FlowMatcher,
    settings: FrameMatchSettings,
) -> tuple[Measurements, np.ndarray]:
    """What all cameras of a frame, that the reference has too, say of a mesh.

    Args:
        reference: with its images.
        frame: with its images.
        vertices_mm: (V, 3) the frame's mesh as it is thought to be, world, mm.
        matcher: of images.
        settings: see `FrameMatchSettings`.

    Returns:
        the measurements, and the mesh's normals (V, 3).
    """
    caster = RayCaster(vertices_mm, reference.triangles)
    normals = vertex_normals(vertices_mm, reference.triangles)
    jacobians, motions = [], []
    for name, view in frame.views.items():
        if name not in reference.sights:
            continue
        seen = sight(caster, view.camera, vertices_mm, normals)
        motions.append(
            measure_motion(
                matcher,
                rasterise(caster, view.camera, seen, settings.ray_stride_px),
                seen,
                view,
                reference.frame.views[name],
                reference.sights[name],
                min_agreement=settings.min_agreement,
            )
        )
        jacobians.append(view.camera.pixel_jacobian(vertices_mm))
    measured = Measurements(
        np.array(jacobians),
        np.array([m.offset_px for m in motions]),
        np.array([m.weight for m in motions]),
    )
    return measured, normals
