"""Every regressor on the held-out frames of a take, against truth or against held-out H."""

from pathlib import Path

import numpy as np

from vermilion.config.evaluation import MeasuresConfig, ReferenceConfig
from vermilion.correspondence.correspondence import Correspondence
from vermilion.errors import InputError
from vermilion.evaluation.closest import SurfacePoints
from vermilion.evaluation.contour_error import contour_error
from vermilion.evaluation.corrected import (
    CoarseTake,
    corrected_by,
    corrected_by_truth,
    measure_name,
)
from vermilion.evaluation.errors import sums_of_frames
from vermilion.evaluation.figures import map_frames
from vermilion.evaluation.files import frames_of, read_chunks, save_arrays, save_sums
from vermilion.evaluation.masks import lip_labels, regions_of_mask
from vermilion.evaluation.measures import measure_rows
from vermilion.evaluation.reference import reference_of, truth_of_vertices
from vermilion.evaluation.take import evaluate_take, sums_of_layers
from vermilion.faces.model import FaceModel
from vermilion.logfile import log_to
from vermilion.mesh import triangle_areas
from vermilion.quality import QualityRow, write_quality
from vermilion.regression.model import load_model
from vermilion.sequences import read_sequence
from vermilion.tables import write_table
from vermilion.tracking.result import Identity, TrackedTake


def at_frames(paths, frames):
    """Meshes (F, V, 3) of chunk files at frame numbers."""
    row_of = {int(frame): row for row, frame in enumerate(frames_of(paths))}
    return read_sequence(paths)[[row_of[int(frame)] for frame in frames]]


def reference(snakemake, tracker, correspondence, frames):
    """Truth where it is given, else H, at the frames."""
    inputs = snakemake.input
    on_h = SurfacePoints(
        correspondence.vertices.triangle,
        correspondence.vertices.barycentric,
        correspondence.distance_mm,
    )
    if not inputs.get("truth"):
        vertices = at_frames(inputs.accurate, frames)
        return reference_of("H", on_h, vertices, correspondence.accurate_triangles)
    cfg = ReferenceConfig(**snakemake.params.cfg["evaluation.reference"])
    triangles = np.load(inputs.neutral_truth[1])
    where = truth_of_vertices(
        on_h,
        np.asarray(read_sequence(inputs.neutral_accurate)[0], dtype=np.float64),
        correspondence.accurate_triangles,
        lip_labels(FaceModel.load(inputs.template)),
        lip_labels(tracker),
        np.load(inputs.neutral_truth[0], mmap_mode="r")[0].astype(np.float64),
        triangles,
        cfg.max_distance_mm,
        np.cos(np.radians(cfg.max_normal_angle_deg)),
    )
    sequence = np.load(inputs.truth[0], mmap_mode="r")[frames - snakemake.params.first]
    return reference_of("truth", where, sequence, triangles)


def coarse_take(snakemake, tracker, fit, rows, frames):
    """The coarse track at the frames, with its features."""
    features = read_chunks(snakemake.input.features, frames, ["features", "valid"])
    values = np.where(features["valid"][:, None], features["features"], np.nan)
    return CoarseTake(
        np.asarray(at_frames(snakemake.input.coarse, frames), dtype=np.float64),
        tracker.triangles,
        Identity.load(snakemake.input.identity).neutral_mm,
        fit.world_from_head_rotation[rows],
        fit.world_from_head_translation_mm[rows],
        values,
        snakemake.params.cfg["correction.integration"]["seam_mm"],
    )


def main(snakemake):
    wildcards, inputs, cfg = snakemake.wildcards, snakemake.input, snakemake.params.cfg
    place = {"subject": wildcards.subject, "take": wildcards.take}
    options = MeasuresConfig(**cfg["evaluation.measures"])
    tracker, correspondence = (
        FaceModel.load(inputs.tracker),
        Correspondence.load(inputs.correspondence),
    )
    fit = TrackedTake.load(inputs.fit)
    asked = np.array(snakemake.params.frames)
    tracked = fit.valid[fit.index_of(asked)]
    frames, rows = asked[tracked], fit.index_of(asked)[tracked]
    if len(frames) == 0:
        raise InputError(
            "no tracked frame among those held out",
            "at least one",
            "See the take's tracking overlay, or set its split to `none`.",
            **place,
        )
    truth = reference(snakemake, tracker, correspondence, frames)
    regions = regions_of_mask(tracker, correspondence.coarse_neutral_mm, correspondence.mask)
    take = coarse_take(snakemake, tracker, fit, rows, frames)

    sequences, regressed, seconds = {"base": take.coarse_mm}, {}, {}
    layers = None
    if inputs.get("layers"):
        layers = read_chunks(inputs.layers, frames, ["layers", "valid"])
        sequences["oracle"] = corrected_by_truth(
            correspondence.mask, layers["layers"], layers["valid"], take
        )
    for path in inputs.models:
        model, name = load_model(path), measure_name(Path(path).stem)
        sequences[name], seconds[name] = corrected_by(model, take)
        regressed[name] = model
    result = evaluate_take(
        sequences, frames, tracker, regions, truth,
        options.clip_frames, options.min_clips, options.touch_mm, options.gape_mm,
    )  # fmt: skip

    sums = dict(result.sums)
    contours = read_chunks(inputs.features, frames, ["outer_px", "inner_px"])
    eyes = fit.camera.project(take.coarse_mm[:, tracker.landmarks[[36, 45]]])
    for name, sequence in sequences.items():
        distance = contour_error(
            sequence, fit.camera, [tracker.outer_contour, tracker.inner_contour],
            [contours["outer_px"], contours["inner_px"]],
            np.linalg.norm(eyes[:, 0] - eyes[:, 1], axis=1),
        )  # fmt: skip
        sums[name] += sums_of_frames("mouth.contour", distance, result.clips)
    for name, model in regressed.items():
        each = np.full(len(frames), seconds[name])
        sums[name] += sums_of_frames("mouth.seconds", each, result.clips)
        if layers is not None:
            common, ours, theirs = np.intersect1d(
                model.mask, correspondence.mask, return_indices=True
            )
            areas = triangle_areas(take.neutral_mm, tracker.triangles[common])
            known = np.isfinite(take.features).all(axis=1) & layers["valid"]
            predicted = np.full((len(frames), len(common), 9), np.nan)
            if known.any():
                predicted[known] = model.predict(take.features[known])[:, ours]
            sums[name] += sums_of_layers(
                predicted, layers["layers"][:, theirs], areas, result.clips
            )

    out = snakemake.output
    save_sums(out.sums, sums, len(frames))
    table = measure_rows(
        sums, wildcards.subject, wildcards.take, len(frames),
        options.bootstrap_samples, options.confidence, options.seed,
    )  # fmt: skip
    write_table(out.measures, table)
    print(table.to_string())
    write_table(out.frames, result.table)
    base_error = result.table.query("regressor == 'base'")["mouth_mm"].to_numpy()
    chosen = map_frames(base_error, cfg["evaluation.figures.map_frames"])
    turn = result.head_rotations[chosen].transpose(0, 2, 1)
    save_arrays(
        out.maps,
        {
            "frames": frames[chosen],
            "regressors": np.array(list(sequences)),
            "meshes_mm": np.stack(
                [result.aligned_mm[name][chosen] @ turn for name in sequences]
            ).astype(np.float32),
            "errors_mm": np.stack([result.errors_mm[name][chosen] for name in sequences]).astype(
                np.float32
            ),
            "triangles": tracker.triangles,
            "mouth": regions.weights["mouth"] > 0,
        },
    )
    errors = dict(zip(frames.tolist(), base_error, strict=True))
    write_quality(
        out.quality,
        *place.values(),
        "evaluation",
        [
            QualityRow(int(frame), True, "", {"base_mouth_mm": errors[int(frame)]})
            if ok
            else QualityRow(int(frame), False, "not tracked, so not measured")
            for frame, ok in zip(asked, tracked, strict=True)
        ],
    )


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
