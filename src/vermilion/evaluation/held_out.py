"""Held-out frames: what they are compared with, and every regressor on them."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from vermilion.config.regressors import is_shown
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, Corrector
from vermilion.evaluation.contour_error import contour_error
from vermilion.evaluation.errors import ClipSums, sums_of_frames
from vermilion.evaluation.reference import Reference
from vermilion.evaluation.take import TakeResult
from vermilion.faces.model import FaceModel
from vermilion.features.occluding import OccludingContour
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import triangle_areas
from vermilion.landmarks.scheme import EYE_CORNERS
from vermilion.regression.model import LipModel


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
    def of(
        cls, model: LipModel, take: CoarseTake, settings: CorrectionSettings, rows: np.ndarray
    ) -> Regressed:
        """Meshes of the frames `rows` (n,) of the take, whose other frames are their neighbours.

        The time is that from features to vertices. The factorisation, once a person, and what is compiled
        at the first frame are not in it. NaN where no frame is usable.
        """
        corrector, usable = Corrector(model, take, settings), take.usable(take.features)
        corrector.correct(take[np.flatnonzero(usable)[:1]])
        start = time.perf_counter()
        corrected_mm = corrector.correct(take)[rows]
        seconds = time.perf_counter() - start
        return cls(model, corrected_mm, seconds / usable.sum() if usable.any() else np.nan)


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
        outer_px, inner_px: (F, n, 2) contour points found in the image; NaN where none.
        clips: (F,) clip of each frame.
    """
    eyes = camera.project(coarse_mm[:, tracker.landmarks[EYE_CORNERS]])
    distance = contour_error(
        sequence_mm,
        camera,
        tracker.outer_contour,
        OccludingContour.of(tracker),
        outer_px,
        inner_px,
        np.linalg.norm(eyes[:, 0] - eyes[:, 1], axis=1),
    )
    return sums_of_frames("mouth.contour", distance, clips)


def layer_errors(regressed: Regressed, take: CoarseTake, true: TrueLayers) -> np.ndarray:
    """RMS of regressed against true layer entries, weighted by area, (F,); NaN where one is unknown.

    Lips16's error in feature space.
    """
    errors = np.full(len(take.features), np.nan)
    common, ours, theirs = np.intersect1d(regressed.model.mask, true.mask, return_indices=True)
    known = np.isfinite(take.features).all(axis=1) & true.valid
    if known.any():
        predicted = regressed.model.predict(take.features[known], take.neutral_mm)[:, ours]
        square = ((predicted - true.layers[known][:, theirs]) ** 2).mean(axis=2)
        areas = triangle_areas(take.neutral_mm, take.triangles[common])
        errors[known] = np.sqrt(square @ areas / areas.sum())
    return errors


def shown_rows(error_mm: np.ndarray, count: int) -> np.ndarray:
    """Rows, ascending, of the frame of the largest `error_mm` (F,) in each of `count` equal stretches."""
    stretches = np.array_split(np.arange(len(error_mm)), min(count, len(error_mm)))
    filled = np.nan_to_num(error_mm)
    return np.array([part[np.argmax(filled[part])] for part in stretches if len(part)])


def shown_arrays(
    result: TakeResult,
    take: CoarseTake,
    count: int,
    reference: Reference,
    neutral_mm: np.ndarray,
    mouth: np.ndarray,
    tracker: FaceModel,
    camera: Camera,
) -> dict[str, np.ndarray]:
    """What the sheets of renders need, of the `count` frames that the report shows (`is_shown`).

    Args:
        neutral_mm: (V, 3) of the base track.
        mouth: (V,) bool, the mouth mask.

    Returns:
        frames (n,), regressors (R,), meshes_mm (R, n, V, 3) in the head frame, errors_mm (R, n, V),
        neutrals_mm (R, V, 3), points_mm (n, V, 3) where they belong, rest_mm (V, 3) of the neutral,
        surface_mm (n, S, 3) and surface_triangles of the reference, triangles, mouth, vermilion,
        centre_px (n, 2) of the lips and px_per_mm (n,) in the image.
    """
    base = result.table.loc[result.table["regressor"] == "base", "mouth_mm"].to_numpy()
    chosen = shown_rows(base, count)
    head = result.head[chosen]
    names = [name for name in result.aligned_mm if is_shown(name)]
    of_truth = {"base": neutral_mm, "contour": neutral_mm, "null": neutral_mm}
    used = np.unique(reference.triangles)
    lips = tracker.regions["vermilion_upper"] | tracker.regions["vermilion_lower"]
    local = camera.to_camera(take.coarse_mm[chosen][:, lips].mean(axis=1))
    arrays = {
        "meshes_mm": np.stack([head.apply(result.aligned_mm[n][chosen]) for n in names]),
        "errors_mm": np.stack([result.errors_mm[n][chosen] for n in names]),
        "neutrals_mm": np.stack([of_truth.get(n, reference.rest_mm) for n in names]),
        "points_mm": head.apply(reference.points_mm[chosen]),
        "rest_mm": reference.rest_mm,
        "surface_mm": head.apply(reference.vertices_mm[chosen][:, used]),
    }
    return {name: values.astype(np.float32) for name, values in arrays.items()} | {
        "frames": take.frames[chosen],
        "regressors": np.array(names),
        "surface_triangles": np.searchsorted(used, reference.triangles),
        "triangles": tracker.triangles,
        "mouth": mouth,
        "vermilion": lips,
        "centre_px": camera.project(take.coarse_mm[chosen][:, lips].mean(axis=1)),
        "px_per_mm": camera.calibration[0, 0] / local[:, 2],
    }
