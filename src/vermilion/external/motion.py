"""Pose and weights of a foreign sequence, as our own tracker writes them."""

from __future__ import annotations

import numpy as np

from vermilion.external.placement import Placement
from vermilion.external.shape_modes import has_modes, mode_weights
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import FrameAlignment, align_frames, move_frames
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_areas
from vermilion.geometry.rotations import exp_about_mean, log_about_mean
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import JAW, interocular_px
from vermilion.tracking.landmark_fit.start import fill_gaps
from vermilion.tracking.result import TrackedTake, camera_arrays

_TRIM, _ROUNDS = 0.2, 2


def heads_of(model: FaceModel, own_mm: np.ndarray, neutral_mm: np.ndarray) -> FrameAlignment:
    """The motion of each frame (F, V, 3) of a sequence into the head frame, by the rigid region.

    Args:
        model: of the topology, for its rigid region.
        own_mm: (F, V, 3), any world, mm; NaN for a frame that is lost.
        neutral_mm: (V, 3) head frame.
    """
    rigid = model.regions["rigid"] * vertex_areas(neutral_mm, model.triangles)
    return align_frames(own_mm, neutral_mm, rigid, trim=_TRIM, rounds=_ROUNDS)


def displacements_of(
    model: FaceModel, own_mm: np.ndarray, neutral_mm: np.ndarray
) -> tuple[np.ndarray, FrameAlignment]:
    """Displacements (F, V, 3) from the neutral in the head frame, mm, and the heads.

    Args:
        model: of the topology, for its rigid region.
        own_mm: (F, V, 3), any world, mm; NaN for a frame that is lost.
        neutral_mm: (V, 3) head frame.
    """
    heads = heads_of(model, own_mm, neutral_mm)
    return heads.apply(own_mm) - neutral_mm, heads


def neutral_in_head(model: FaceModel, own_mm: np.ndarray) -> np.ndarray:
    """A person's neutral (V, 3) in the head frame, laid on that of the model by the rigid region.

    `own_mm` (V, 3) is their neutral in the tracker's world, mm.
    """
    return heads_of(model, own_mm[None], model.neutral_mm).apply(own_mm[None])[0]


def external_take(
    model: FaceModel,
    own_mm: np.ndarray,
    neutral_mm: np.ndarray,
    weights: np.ndarray | None,
    placement: Placement,
    camera: Camera,
    track: LandmarkTrack,
    max_reprojection: float,
) -> TrackedTake:
    """Poses and weights of a whole take in the world of the capture.

    A frame that the sequence lost is not valid; its pose and weights are interpolated. A frame whose
    mesh misses the detected landmarks is not valid either.

    Args:
        model: of the tracker's topology, with expressions.
        own_mm: (F, V, 3) the sequence in the tracker's world, mm; NaN for a lost frame.
        neutral_mm: (V, 3) the person's neutral, head frame.
        weights: (F, K) the tracker's own; None: those of the modes nearest to the meshes.
        placement: of the tracker's world.
        camera: of the images.
        track: 66 landmarks of the same frames.
        max_reprojection: largest RMS error of a valid frame, inter-ocular distances.

    Raises:
        ValueError: no frame has a mesh.
    """
    moved, heads = displacements_of(model, own_mm, neutral_mm)
    there = np.isfinite(moved).all(axis=(1, 2))
    if not there.any():
        raise ValueError("a sequence without a mesh")
    if weights is None:
        weights = np.full((len(own_mm), model.n_expressions), np.nan)
        if has_modes(model):
            weights[there] = mode_weights(model, moved[there])
    turned = np.swapaxes(heads.rotations, 1, 2)
    rotation = placement.rotation @ turned
    translation = placement.apply(-np.einsum("fij,fj->fi", turned, heads.translations_mm))
    points_mm = placement.apply(own_mm[:, model.landmarks].astype(np.float64))
    error, unit_px = _reprojection_px(points_mm, camera, track), interocular_px(track.points_px)
    with np.errstate(invalid="ignore"):
        missed = error > max_reprojection * unit_px
    frames, pieces = track.frames, track.pieces
    rotation, translation, weights = _filled(pieces, there, rotation, translation, weights)
    return TrackedTake(
        frames=np.asarray(frames),
        weights=weights,
        expression_names=np.array(model.expression_names, dtype=str),
        world_from_head_rotation=rotation,
        world_from_head_translation_mm=translation,
        valid=there & ~missed,
        reprojection_px=error,
        **camera_arrays(camera),
        piece=np.asarray(pieces),
    )


def _reprojection_px(points_mm: np.ndarray, camera: Camera, track: LandmarkTrack) -> np.ndarray:
    """RMS distance (F,) of landmarks (F, 66, 3) from the detected ones, without the jaw's; NaN where unknown."""
    away = np.linalg.norm(camera.project(points_mm) - track.points_px, axis=2)[:, len(JAW) :]
    return np.sqrt((away**2).mean(axis=1))


def _filled(
    pieces: np.ndarray,
    there: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
    weights: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses and weights, interpolated where a frame is not `there` (F,) bool, never across a cut."""
    known = np.flatnonzero(there)
    vectors, mean = log_about_mean(rotation[known])
    values = np.concatenate([vectors, translation[known], np.nan_to_num(weights[known])], axis=1)
    values = fill_gaps(values, known, pieces)
    return exp_about_mean(values[:, :3], mean), values[:, 3:6], values[:, 6:]


def placed_meshes(
    model: FaceModel,
    fit: TrackedTake,
    rows: np.ndarray,
    own_mm: np.ndarray,
    neutral_mm: np.ndarray,
    placement: Placement,
) -> np.ndarray:
    """**C** (F, V, 3) mm in the world of the capture; lost frames from their interpolated pose and weights.

    Args:
        model, placement: as in `external_take`, which gave the `fit`.
        neutral_mm: (V, 3) the person's neutral, head frame.
        rows: (F,) int rows of the fit.
        own_mm: (F, V, 3) the sequence of these rows.
    """
    placed = placement.apply(np.asarray(own_mm, dtype=np.float64))
    lost = np.flatnonzero(~np.isfinite(placed).all(axis=(1, 2)))
    if len(lost):
        weights = fit.weights[rows[lost]]
        heads = neutral_mm + np.tensordot(weights, model.expressions_mm.astype(np.float64), axes=1)
        placed[lost] = move_frames(
            heads,
            fit.world_from_head_rotation[rows[lost]],
            fit.world_from_head_translation_mm[rows[lost]],
        )
    return placed
