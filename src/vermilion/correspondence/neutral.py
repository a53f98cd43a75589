"""The correspondence of a take's neutral frame: from tracked meshes and an image's landmarks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vermilion.correspondence.binding import flipped_triangles
from vermilion.correspondence.correspondence import (
    Correspondence,
    CorrespondenceSettings,
    MarkedMesh,
    find_correspondence,
    mouth_mask,
)
from vermilion.correspondence.landmarks import back_project, inner_features
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.closest_points import closest_barycentric
from vermilion.geometry.head_frame import head_from_world
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import EYE_LEFT, EYE_RIGHT, MOUTH
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow
from vermilion.tracking.result import TrackedTake


@dataclass(frozen=True)
class NeutralFrame:
    """A take's first frame.

    Attributes:
        coarse: C in the world.
        accurate: H in the world.
        camera: of the monocular images.
        points_px: (66, 2) landmarks of its image.
        rotation, translation_mm: (3, 3), (3,) `world_from_head` of the tracker.
        subject, take: for messages.
    """

    coarse: Mesh
    accurate: Mesh
    camera: Camera
    points_px: np.ndarray
    rotation: np.ndarray
    translation_mm: np.ndarray
    subject: str
    take: str

    @classmethod
    def of(
        cls,
        coarse: Mesh,
        accurate: Mesh,
        fit: TrackedTake,
        track: LandmarkTrack,
        *,
        subject: str,
        take: str,
    ) -> NeutralFrame:
        """Take the first frame. Raises InputError where it was not tracked."""
        frame = int(fit.frames[0])
        row = np.flatnonzero(track.frames == frame)
        if not fit.valid[0] or not len(row) or not track.valid[row[0]]:
            raise InputError(
                "a first frame that was not tracked",
                "the neutral, with a face that landmarks are found on",
                "Look at the take's landmark and tracking overlays; start the take at a frame that "
                "shows the neutral face.",
                subject=subject,
                take=take,
                frame=frame,
            )
        return cls(
            coarse=coarse,
            accurate=accurate,
            camera=fit.camera,
            points_px=np.asarray(track.points_px[row[0]], np.float64),
            rotation=fit.world_from_head_rotation[0],
            translation_mm=fit.world_from_head_translation_mm[0],
            subject=subject,
            take=take,
        )


def correspond_neutrals(
    neutral: NeutralFrame,
    tracker: FaceModel,
    template: FaceModel,
    landmarks: Literal["image", "model"],
    settings: CorrespondenceSettings,
) -> tuple[Correspondence, Mesh, tuple[SurfacePoints, SurfacePoints]]:
    """Find the correspondence of a subject.

    Args:
        neutral: the take's first frame.
        tracker, template: models of C's and H's topology, for regions.
        landmarks: `image` or `model`, see the configuration.
        settings: of `find_correspondence`.

    Returns:
        the correspondence, C registered over H in H's world, and the landmarks on C and on H.

    Raises:
        InputError: too few landmarks on both meshes, or no mouth in common.
    """
    coarse, accurate = _marked(neutral, tracker, template, landmarks)
    points = coarse.landmarks.sample(coarse.mesh.vertices_mm, coarse.mesh.triangles)
    lips, lids = points[MOUTH], points[np.concatenate([EYE_RIGHT, EYE_LEFT])]
    place = {"subject": neutral.subject, "take": neutral.take}
    if not np.isfinite(lips).all(axis=1).any():
        raise InputError(
            "no lip landmark whose ray meets the coarse mesh",
            "a tracked mouth",
            "Look at the take's tracking overlay: the mesh does not lie over the face.",
            **place,
        )
    lids = lids[np.isfinite(lids).all(axis=1)]
    try:
        found, registered = find_correspondence(
            coarse, accurate, np.nanmean(lips, axis=0), lids, settings
        )
    except ValueError as error:
        raise InputError(
            str(error),
            "two neutrals of the same face",
            "Look at the take's tracking and multiview overlays.",
            **place,
        ) from error
    return found, registered, (coarse.landmarks, accurate.landmarks)


def _marked(
    neutral: NeutralFrame, tracker: FaceModel, template: FaceModel, landmarks: str
) -> tuple[MarkedMesh, MarkedMesh]:
    """C in its head frame and H in the world, with landmarks and regions."""
    marked = []
    for mesh, model in ((neutral.coarse, tracker), (neutral.accurate, template)):
        if landmarks == "model":
            seen = SurfacePoints.at_vertices(model.landmarks, model.triangles)
        else:
            seen = back_project(neutral.points_px, neutral.camera, mesh)
        marked.append(MarkedMesh(mesh, inner_features(seen), model.regions))
    head = head_from_world(
        neutral.coarse.vertices_mm[None], neutral.rotation[None], neutral.translation_mm[None]
    )
    return replace(marked[0], mesh=neutral.coarse.with_vertices(head[0])), marked[1]


def model_mouth_mask(
    face: FaceModel, neutral_mm: np.ndarray, settings: CorrespondenceSettings
) -> np.ndarray:
    """The mask of a person's mesh where no accurate mesh is known, (M,) int32 triangle ids.

    Args:
        face: the tracker's model.
        neutral_mm: (V, 3) of the person, head frame.
        settings: `mask_radius_mm` and `eye_gap_mm`.
    """
    points_mm = neutral_mm[face.landmarks]
    marked = MarkedMesh(
        Mesh(np.asarray(neutral_mm, dtype=np.float64), face.triangles),
        SurfacePoints.at_vertices(face.landmarks, face.triangles),
        face.regions,
    )
    lids_mm = points_mm[np.concatenate([EYE_RIGHT, EYE_LEFT])]
    every = np.ones(len(face.triangles), dtype=bool)
    return mouth_mask(marked, points_mm[MOUTH].mean(axis=0), lids_mm, every, settings)


def quality_of(found: Correspondence, registered: Mesh, accurate: Mesh, frame: int) -> QualityRow:
    """Coverage, distances and folds of the mask; a row with a reason where they look wrong."""
    corners = found.coarse_triangles[found.mask]
    distance = found.distance_mm[np.unique(corners)].astype(np.float64)
    flipped = flipped_triangles(found.vertices, found.coarse_triangles, accurate)
    centres = triangle_distances(found, registered, accurate)[found.mask]
    bound = found.vertices.bound
    figures = {
        "mask_triangles": len(found.mask),
        "bound_share": float(bound.mean()),
        "distance_mean_mm": float(distance.mean()),
        "distance_p95_mm": float(np.percentile(distance, 95)),
        "triangle_distance_mean_mm": float(centres.mean()),
        "flipped_triangles": int(flipped.sum()),
    }
    reasons = []
    if figures["bound_share"] < 0.6:
        reasons.append(f"only {figures['bound_share']:.0%} of the coarse mesh has a counterpart")
    if figures["distance_p95_mm"] > 2.0:
        reasons.append(f"95 % of distances reach {figures['distance_p95_mm']:.1f} mm")
    return QualityRow(frame, not reasons, "; ".join(reasons), figures)


def triangle_distances(found: Correspondence, registered: Mesh, accurate: Mesh) -> np.ndarray:
    """From the centre of each registered C triangle to its triangle of H, (T,) mm, NaN without one."""
    mapped = found.triangles >= 0
    centres = registered.vertices_mm[registered.triangles].mean(axis=1)
    corners = accurate.vertices_mm[accurate.triangles[np.maximum(found.triangles, 0)]]
    nearest = (closest_barycentric(centres, corners)[..., None] * corners).sum(axis=1)
    return np.where(mapped, np.linalg.norm(nearest - centres, axis=1), np.nan)
