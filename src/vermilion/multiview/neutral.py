"""The template registered to the neutral frame: landmarks, cloud, photo-consistency (Lips16 3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.multiview.cloud import fuse, near_mesh, screened_poisson
from vermilion.multiview.nonrigid import register_to_cloud
from vermilion.multiview.pairs import candidate_pairs, stereo_pairs
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.polish import polish
from vermilion.multiview.solver import ThinPlate
from vermilion.multiview.stereo import Cloud, match_pair
from vermilion.multiview.template_fit import deform_to_landmarks, fit_template
from vermilion.multiview.triangulate import Triangulated
from vermilion.multiview.views import Frame
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class StereoSettings:
    """Dense matching; see `vermilion.config.multiview` for meanings and units."""

    pairs: Sequence[tuple[str, str]]
    reach_mm: float
    block_px: int
    uniqueness_percent: int
    consistency_px: float
    speckle_px: int
    min_texture: float
    spacing_mm: float


@dataclass(frozen=True)
class NeutralSettings:
    """Registration of the neutral; see `vermilion.config.multiview` for meanings and units."""

    landmark_sigma_mm: float
    landmark_length_mm: float
    first_gate_mm: float
    last_gate_mm: float
    first_length_mm: float
    last_length_mm: float
    rounds: int
    poisson_depth: int
    polish_lengths_mm: Sequence[float]
    polish_min_angle_deg: float
    polish_max_angle_deg: float
    sigma_px: float


@dataclass(frozen=True)
class Neutral:
    """The registered neutral.

    Attributes:
        vertices_mm: (V, 3) in the world, the template's topology.
        information: (V,) 1/mm^2 along the normal, from the photo-consistency of the cameras; zero
            where no pair of cameras sees the vertex.
        landmarks: what was triangulated.
        cloud: fused points of the face.
        surface: screened Poisson surface of the cloud.
        first_take: whose points of the skin the vertices are; empty: this take's own fit.
        moved_mm: (V,) from this take's own fit to those points; zero where there is none.
    """

    vertices_mm: np.ndarray
    information: np.ndarray
    landmarks: Triangulated
    cloud: Cloud
    surface: Mesh
    first_take: str = ""
    moved_mm: np.ndarray | float = 0.0


def stereo_cloud(frame: Frame, target_mm: np.ndarray, settings: StereoSettings) -> Cloud:
    """Points of all stereo pairs of a frame within reach of a point, not yet gated or fused."""
    cameras = {name: view.camera for name, view in frame.views.items()}
    listed = [pair for pair in settings.pairs if all(n in cameras for n in pair)]
    return Cloud.join(
        [
            match_pair(
                frame.views[a],
                frame.views[b],
                target_mm,
                settings.reach_mm,
                block_px=settings.block_px,
                uniqueness_percent=settings.uniqueness_percent,
                consistency_px=settings.consistency_px,
                speckle_px=settings.speckle_px,
                min_texture=settings.min_texture,
            )
            for a, b in stereo_pairs(cameras, target_mm, listed)
        ]
    )


def register_neutral(
    frame: Frame,
    model: FaceModel,
    landmarks: Triangulated,
    stereo: StereoSettings,
    settings: NeutralSettings,
    matcher: FlowMatcher,
) -> Neutral:
    """Register the template to a frame.

    Raises InputError where there are too few landmarks or points.
    """
    if landmarks.valid.sum() < 6:
        raise InputError(
            f"{int(landmarks.valid.sum())} landmarks that two views agree on",
            "six or more",
            "Check the cameras' calibration, or give landmark labels of the neutral.",
            frame=frame.number,
        )
    fitted = fit_template(model, landmarks, identity_sigma_mm=settings.landmark_sigma_mm)
    plate = ThinPlate.of(fitted, model.triangles)
    start = deform_to_landmarks(
        fitted,
        plate,
        model.landmarks,
        landmarks,
        length_mm=settings.landmark_length_mm,
        sigma_mm=settings.landmark_sigma_mm,
    )
    skin = ~(model.regions["mouth_inner"] | model.regions["eyes"])
    target = np.nanmean(landmarks.points_mm[landmarks.valid], axis=0)
    raw = stereo_cloud(frame, target, stereo)
    cloud = fuse(
        near_mesh(raw, Mesh(start, model.triangles), settings.first_gate_mm, skin, 0.2),
        stereo.spacing_mm,
    )
    if len(cloud) < 1000:
        raise InputError(
            f"{len(cloud)} stereo points on the face",
            "thousands",
            "Check the stereo pairs and the cameras' calibration.",
            frame=frame.number,
        )
    anneal = np.linspace(0, 1, settings.rounds)
    lengths = settings.first_length_mm ** (1 - anneal) * settings.last_length_mm**anneal
    gates = settings.first_gate_mm ** (1 - anneal) * settings.last_gate_mm**anneal
    placed = register_to_cloud(
        start,
        model.triangles,
        cloud,
        skin,
        lengths_mm=lengths,
        gates_mm=gates,
        spacing_mm=stereo.spacing_mm,
    )
    cloud = near_mesh(cloud, Mesh(placed, model.triangles), settings.last_gate_mm, skin, 0.3)
    surface = screened_poisson(cloud, settings.poisson_depth, 2 * stereo.spacing_mm)
    cameras = {name: view.camera for name, view in frame.views.items()}
    pairs = candidate_pairs(
        cameras,
        target,
        min_angle_deg=settings.polish_min_angle_deg,
        max_angle_deg=settings.polish_max_angle_deg,
        max_density_ratio=1.5,
    ) or stereo_pairs(cameras, target, stereo.pairs)
    polished, information = polish(
        frame,
        placed,
        model.triangles,
        pairs,
        matcher,
        lengths_mm=settings.polish_lengths_mm,
        sigma_px=settings.sigma_px,
        max_offset_mm=settings.last_gate_mm,
    )
    return Neutral(polished, information, landmarks, cloud, surface)
