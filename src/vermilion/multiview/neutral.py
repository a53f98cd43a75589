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
from vermilion.multiview.polish import PairedImages, polish
from vermilion.multiview.solver import ThinPlate
from vermilion.multiview.stereo import Cloud, StereoSettings, match_pair
from vermilion.multiview.template_fit import deform_to_landmarks, fit_template
from vermilion.multiview.triangulate import Triangulated
from vermilion.multiview.views import Frame
from vermilion.storage.errors import InputError


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
    """Points of all stereo pairs of a frame within reach of target_mm (3,), not gated or fused."""
    cameras = {name: view.camera for name, view in frame.views.items()}
    listed = [pair for pair in settings.pairs if all(n in cameras for n in pair)]
    pairs = stereo_pairs(cameras, target_mm, listed)
    return Cloud.join(
        [match_pair(frame.views[a], frame.views[b], target_mm, settings) for a, b in pairs]
    )


def skin_of(model: FaceModel) -> np.ndarray:
    """Vertices (V,) bool that stereo points may pull: not the inside of the mouth, not the eyes."""
    return ~(model.regions["mouth_inner"] | model.regions["eyes"])


def register_neutral(
    frame: Frame,
    model: FaceModel,
    landmarks: Triangulated,
    stereo: StereoSettings,
    settings: NeutralSettings,
    matcher: FlowMatcher,
) -> Neutral:
    """Register the template to a frame.

    Args:
        frame: the neutral, full size.
        model: the template, V vertices.
        landmarks: of the frame.
        stereo, settings: see their classes.
        matcher: of images.

    Raises:
        InputError: too few landmarks or points.
    """
    if landmarks.valid.sum() < 6:
        raise InputError(
            f"{int(landmarks.valid.sum())} landmarks that two views agree on",
            "six or more",
            "Check the cameras' calibration, or give landmark labels of the neutral.",
            frame=frame.number,
        )
    start = _on_landmarks(model, landmarks, settings)
    skin = skin_of(model)
    target = np.nanmean(landmarks.points_mm[landmarks.valid], axis=0)
    raw = stereo_cloud(frame, target, stereo)
    raw = near_mesh(raw, Mesh(start, model.triangles), settings.first_gate_mm, skin, 0.2)
    cloud = _fused(raw, stereo.spacing_mm, frame.number)
    anneal = np.linspace(0, 1, settings.rounds)
    placed = register_to_cloud(
        start,
        model.triangles,
        cloud,
        skin,
        lengths_mm=settings.first_length_mm ** (1 - anneal) * settings.last_length_mm**anneal,
        gates_mm=settings.first_gate_mm ** (1 - anneal) * settings.last_gate_mm**anneal,
        spacing_mm=stereo.spacing_mm,
    )
    cloud = near_mesh(cloud, Mesh(placed, model.triangles), settings.last_gate_mm, skin, 0.3)
    surface = screened_poisson(cloud, settings.poisson_depth, 2 * stereo.spacing_mm)
    pairs = _polish_pairs(frame, target, stereo, settings)
    images = PairedImages(frame, pairs, matcher, settings.sigma_px, settings.last_gate_mm)
    polished, information = polish(images, placed, model.triangles, settings.polish_lengths_mm)
    return Neutral(polished, information, landmarks, cloud, surface)


def _fused(raw: Cloud, spacing_mm: float, number: int) -> Cloud:
    """The points fused; raises InputError where few are left."""
    cloud = fuse(raw, spacing_mm)
    if len(cloud) < 1000:
        raise InputError(
            f"{len(cloud)} stereo points on the face",
            "thousands",
            "Check the stereo pairs and the cameras' calibration.",
            frame=number,
        )
    return cloud


def _on_landmarks(
    model: FaceModel, landmarks: Triangulated, settings: NeutralSettings
) -> np.ndarray:
    """The template (V, 3) fitted and deformed to the landmarks, world."""
    fitted = fit_template(model, landmarks, identity_sigma_mm=settings.landmark_sigma_mm)
    return deform_to_landmarks(
        fitted,
        ThinPlate.of(fitted, model.triangles),
        model.landmarks,
        landmarks,
        length_mm=settings.landmark_length_mm,
        sigma_mm=settings.landmark_sigma_mm,
    )


def _polish_pairs(
    frame: Frame, target_mm: np.ndarray, stereo: StereoSettings, settings: NeutralSettings
) -> list[tuple[str, str]]:
    """Pairs of cameras whose images are compared on the surface round a point (3,)."""
    cameras = {name: view.camera for name, view in frame.views.items()}
    found = candidate_pairs(
        cameras, target_mm, settings.polish_min_angle_deg, settings.polish_max_angle_deg
    )
    return found or stereo_pairs(cameras, target_mm, stereo.pairs)
