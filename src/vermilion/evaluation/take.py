"""One take under test: every regressor against the reference, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vermilion.evaluation.errors import (
    ClipSums,
    by_clip,
    sums_by_region,
    sums_of_aperture,
    sums_of_errors,
    sums_of_frames,
    sums_of_jitter,
    surface_errors,
    vertex_errors,
)
from vermilion.evaluation.gap_points import GapPoints
from vermilion.evaluation.kind_errors import sums_of_kinds
from vermilion.evaluation.lip_errors import (
    sums_of_largest_errors,
    sums_of_motion_errors,
    sums_of_shape_errors,
)
from vermilion.evaluation.lips import LipTolerances, aperture_mm, lip_depths
from vermilion.evaluation.masks import Regions
from vermilion.evaluation.mouth_kinds import kinds_of_curves, kinds_of_shapes
from vermilion.evaluation.reference import Reference
from vermilion.evaluation.statistics import clips_of
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import FrameAlignment, align_frames


@dataclass(frozen=True)
class TakeResult:
    """What the measurement of a take gives.

    Attributes:
        sums: regressor -> sums by clip, for `measure_rows`.
        table: per frame and regressor: frame, regressor, kind, vermilion_mm, mouth_mm, aperture_mm; the
            regressor `truth` has its aperture alone.
        aligned_mm: regressor -> (F, V, 3) in the reference's world.
        errors_mm: regressor -> (F, V) vertex error; NaN where a vertex has no counterpart.
        head: of each frame, from the reference's world to the head frame.
        kinds: (F,) kind of mouth shape.
        clips: (F,) clip of each frame.
    """

    sums: dict[str, ClipSums]
    table: pd.DataFrame
    aligned_mm: dict[str, np.ndarray]
    errors_mm: dict[str, np.ndarray]
    head: FrameAlignment
    kinds: np.ndarray
    clips: np.ndarray


def evaluate_take(
    sequences_mm: dict[str, np.ndarray],
    frames: np.ndarray,
    model: FaceModel,
    regions: Regions,
    reference: Reference,
    clip_frames: int,
    min_clips: int,
    tolerances: LipTolerances,
    curves: Sequence[Mapping[str, float]] | None = None,
) -> TakeResult:
    """Measure `base` and its corrections after one rigid alignment a frame.

    Every sequence is aligned on its own face outside the mouth mask: a correction may also have moved
    the head, to lay it on the image.

    Args:
        sequences_mm: regressor -> (F, V, 3) in the tracker's world; has `base`.
        frames: (F,) frame numbers.
        regions: of the topology of the sequences; vertices without a counterpart are left out here.
        reference: of the same frames.
        model: face model of the sequences' topology.
        clip_frames, min_clips: of `clips_of`.
        tolerances: of lips that touch, gape or pass through each other.
        curves: true expression weights of the frames, by which the kinds of mouth shapes are known;
            without them the reference's shape decides.
    """
    regions = regions.restricted(reference.valid)
    aligned = {
        name: align_frames(s, reference.points_mm, regions.rest).apply(s)
        for name, s in sequences_mm.items()
    }
    head = align_frames(reference.points_mm, model.neutral_mm, regions.rest)
    kinds = _mouth_kinds(model, regions, reference, head, curves)
    clips = clips_of(frames, clip_frames, min_clips)
    to_head = np.swapaxes(head.rotations, 1, 2)
    true_gaps = _gaps_of_surface(model, reference, to_head)
    surface = surface_errors(aligned, reference, regions.used)
    # A lip vertex that has no counterpart is left out.
    gap_points = GapPoints.of(model).without(~reference.valid)
    sums, errors, rows = {}, {}, [_frame_rows("truth", frames, None, regions, true_gaps, kinds)]
    for name, sequence in aligned.items():
        gaps = gap_points.gaps(sequence, to_head)
        through = lip_depths(sequence, model) > tolerances.through_mm
        errors[name] = vertex_errors(sequence, reference)
        sums[name] = (
            sums_of_errors(errors[name], surface[name], regions, clips)
            + sums_of_motion_errors(sequence, reference, head.rotations, regions, clips)
            + sums_of_shape_errors(sequence, reference, regions, clips)
            + sums_of_largest_errors(errors[name], regions, clips)
            + sums_of_jitter(sequence, reference, frames, regions, clips)
            + sums_of_aperture(gaps, true_gaps, clips, tolerances)
            + sums_of_kinds(errors[name], kinds, regions, clips)
            + sums_of_frames("mouth.through", through, clips)
        )
        rows.append(_frame_rows(name, frames, errors[name], regions, gaps, kinds))
    table = pd.concat(rows, ignore_index=True)
    return TakeResult(sums, table, aligned, errors, head, kinds, clips)


def _gaps_of_surface(model: FaceModel, reference: Reference, to_head: np.ndarray) -> np.ndarray:
    """(F, columns) mm of the reference's own surface: a coarse mesh on it has its lips less far in the gap."""
    at_rest = reference.rest_mm, reference.rest_surface_mm
    return GapPoints.on(model, *at_rest, reference.triangles).gaps(reference.vertices_mm, to_head)


def _mouth_kinds(
    model: FaceModel,
    regions: Regions,
    reference: Reference,
    head: FrameAlignment,
    curves: Sequence[Mapping[str, float]] | None,
) -> np.ndarray:
    """(F,) kind of mouth shape: by the true expression weights, or by the reference's shape."""
    if curves is not None:
        return kinds_of_curves(curves)
    rest = reference.rest_mm[None]
    rest = align_frames(rest, model.neutral_mm, regions.rest).apply(rest)[0]
    return kinds_of_shapes(head.apply(reference.points_mm), rest, model, reference.valid)


def evaluate_reconstruction(
    sequence_mm: np.ndarray,
    frames: np.ndarray,
    regions: Regions,
    reference: Reference,
    drift_mm: np.ndarray,
    seen: np.ndarray,
    clip_frames: int,
    min_clips: int,
) -> dict[str, ClipSums]:
    """Measure **H** itself against known truth, in the rig's world, without alignment.

    Args:
        sequence_mm: (F, V, 3) of H, world.
        frames: (F,) frame numbers.
        reference: truth, followed from the neutral.
        drift_mm: (F, V) of `drift`.
        seen: (F, V) bool, reference points that enough cameras see; the region `visible` is what
            of the vermilion they show.
    """
    regions = regions.restricted(reference.valid)
    clips = clips_of(frames, clip_frames, min_clips)
    surface = surface_errors({"H": sequence_mm}, reference, regions.used)["H"]
    errors = vertex_errors(sequence_mm, reference)
    shown = Regions({"visible": regions.weights["vermilion"]}, regions.rest)
    hidden = np.where(seen, 0.0, np.nan)
    sums = sums_of_errors(errors, surface, regions, clips)
    sums += sums_of_jitter(sequence_mm, reference, frames, regions, clips)
    sums += sums_by_region("drift", drift_mm, regions, clips)
    sums += sums_of_errors(errors + hidden, surface + hidden, shown, clips)
    sums += sums_by_region("drift", drift_mm + hidden, shown, clips)
    return {"H": sums}


def sums_of_layers(errors: np.ndarray, clips: np.ndarray) -> ClipSums:
    """Sums by `clips` (F,) of the RMS `errors` (F,) of each frame's layer; NaN does not count."""
    known = np.isfinite(errors)
    return ClipSums(
        {
            "mouth.feature_square": by_clip(np.where(known, errors, 0.0) ** 2, clips),
            "mouth.feature_entries": by_clip(known.astype(float), clips),
        }
    )


def with_layer_errors(table: pd.DataFrame, errors: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """The table of `TakeResult` with a column `feature_error`: regressor -> `errors` (F,), else NaN."""
    column = np.full(len(table), np.nan)
    for name, of_frames in errors.items():
        column[(table["regressor"] == name).to_numpy()] = of_frames
    return table.assign(feature_error=column)


def _frame_rows(
    name: str,
    frames: np.ndarray,
    errors_mm: np.ndarray | None,
    regions: Regions,
    gaps: np.ndarray,
    kinds: np.ndarray,
) -> pd.DataFrame:
    columns = {"frame": frames, "regressor": name, "kind": kinds}
    for region in ("vermilion", "mouth"):
        weights = regions.weights[region]
        value = np.full(len(frames), np.nan)
        if errors_mm is not None and weights.sum() > 0:
            known = np.isfinite(errors_mm) @ weights
            np.divide(np.nan_to_num(errors_mm) @ weights, known, out=value, where=known > 0)
        columns[f"{region}_mm"] = value
    columns["aperture_mm"] = aperture_mm(gaps)
    return pd.DataFrame(columns)
