"""Held-out frames: what they are compared with, and every regressor on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.camera import Camera
from vermilion.correspondence.correspondence import Correspondence
from vermilion.evaluation.closest import SurfacePoints
from vermilion.evaluation.contour_error import contour_error
from vermilion.evaluation.corrected import CoarseTake, corrected_by
from vermilion.evaluation.errors import ClipSums, sums_of_frames
from vermilion.evaluation.figures import map_frames
from vermilion.evaluation.masks import lip_labels
from vermilion.evaluation.reference import truth_of_vertices
from vermilion.evaluation.take import TakeResult, sums_of_layers
from vermilion.faces.model import FaceModel
from vermilion.mesh import triangle_areas
from vermilion.regression.model import LipModel

_EYE_CORNERS = (36, 45)


@dataclass(frozen=True)
class TrueLayers:
    """Layers (F, T, 9) of the triangles `mask` (T,) and which frames (F,) have them."""

    mask: np.ndarray
    layers: np.ndarray
    valid: np.ndarray


@dataclass(frozen=True)
class Regressed:
    """A regressor, its meshes (F, V, 3) in the world, and its seconds a frame."""

    model: LipModel
    corrected_mm: np.ndarray
    seconds: float

    @classmethod
    def of(cls, model: LipModel, take: CoarseTake) -> Regressed:
        return cls(model, *corrected_by(model, take))


def points_on_h(correspondence: Correspondence) -> SurfacePoints:
    """The point of H of each vertex of C."""
    at = correspondence.vertices
    return SurfacePoints(at.triangle, at.barycentric, correspondence.distance_mm)


def points_on_truth(
    correspondence: Correspondence,
    tracker: FaceModel,
    template: FaceModel,
    h_neutral_mm: np.ndarray,
    truth_neutral_mm: np.ndarray,
    truth_triangles: np.ndarray,
    max_distance_mm: float,
    max_normal_angle_deg: float,
) -> SurfacePoints:
    """The point of the truth of each vertex of C, by way of H; see `truth_of_vertices`."""
    return truth_of_vertices(
        points_on_h(correspondence),
        np.asarray(h_neutral_mm, dtype=np.float64),
        correspondence.accurate_triangles,
        lip_labels(template),
        lip_labels(tracker),
        np.asarray(truth_neutral_mm, dtype=np.float64),
        truth_triangles,
        max_distance_mm,
        float(np.cos(np.radians(max_normal_angle_deg))),
    )


def sums_of_contours(
    sequence_mm: np.ndarray,
    coarse_mm: np.ndarray,
    tracker: FaceModel,
    camera: Camera,
    outer_px: np.ndarray,
    inner_px: np.ndarray,
    clips: np.ndarray,
) -> ClipSums:
    """Sums behind `contour_error_px`; the inter-ocular distance is that of the coarse mesh.

    Args:
        sequence_mm, coarse_mm: (F, V, 3) in the camera's world.
        outer_px, inner_px: (F, n, 2) contour points found in the picture; NaN where none.
    """
    eyes = camera.project(coarse_mm[:, tracker.landmarks[list(_EYE_CORNERS)]])
    distance = contour_error(
        sequence_mm,
        camera,
        [tracker.outer_contour, tracker.inner_contour],
        [outer_px, inner_px],
        np.linalg.norm(eyes[:, 0] - eyes[:, 1], axis=1),
    )
    return sums_of_frames("mouth.contour", distance, clips)


def sums_of_regressor(
    regressed: Regressed, take: CoarseTake, true: TrueLayers | None, clips: np.ndarray
) -> ClipSums:
    """Sums behind `feature_error`; none where the true layers are not known."""
    if true is None:
        return ClipSums()
    common, ours, theirs = np.intersect1d(regressed.model.mask, true.mask, return_indices=True)
    known = np.isfinite(take.features).all(axis=1) & true.valid
    predicted = np.full((len(clips), len(common), 9), np.nan)
    if known.any():
        predicted[known] = regressed.model.predict(take.features[known], take.neutral_mm)[:, ours]
    areas = triangle_areas(take.neutral_mm, take.triangles[common])
    return sums_of_layers(predicted, true.layers[:, theirs], areas, clips)


def error_map_arrays(
    result: TakeResult, frames: np.ndarray, count: int, triangles: np.ndarray, mouth: np.ndarray
) -> dict[str, np.ndarray]:
    """Meshes in the head frame and errors of the `count` frames that the report shows.

    Returns:
        frames (n,), regressors (R,), meshes_mm (R, n, V, 3), errors_mm (R, n, V), triangles, mouth.
    """
    base = result.table.loc[result.table["regressor"] == "base", "mouth_mm"].to_numpy()
    chosen = map_frames(base, count)
    turn = result.head[0][chosen].transpose(0, 2, 1)
    names = list(result.aligned_mm)
    return {
        "frames": frames[chosen],
        "regressors": np.array(names),
        "meshes_mm": np.stack([result.aligned_mm[n][chosen] @ turn for n in names], dtype=np.float32, casting="same_kind"),
        "errors_mm": np.stack([result.errors_mm[n][chosen] for n in names], dtype=np.float32, casting="same_kind"),
        "triangles": triangles,
        "mouth": mouth,
    }  # fmt: skip
