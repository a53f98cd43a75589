"""Every regressor on the held-out frames of a take, against truth or against held-out H."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vermilion.baselines.contour_tracker import ContourTracker
from vermilion.baselines.lip_shapes import LipShapes
from vermilion.baselines.null import NAME as NULL
from vermilion.baselines.null import null_model
from vermilion.config.correction import CorrectionConfig, ImageAgreementConfig
from vermilion.config.evaluation import MeasuresConfig, ReferenceConfig
from vermilion.config.regressors import GENERIC, is_judged, measure_name
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, correct, correct_with_layers
from vermilion.correction.folds import LipFolds
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.neutral_pair import load_pairs, with_known_neutrals
from vermilion.correction.surface_quality import LipSurface, SurfaceTolerances
from vermilion.correspondence.correspondence import Correspondence
from vermilion.evaluation import held_out
from vermilion.evaluation.errors import sums_of_surface
from vermilion.evaluation.files import save_sums
from vermilion.evaluation.lips import LipTolerances
from vermilion.evaluation.masks import regions_of_mask
from vermilion.evaluation.measures import measure_rows
from vermilion.evaluation.reference import MatchTolerance, reference_of, truth_of_vertices
from vermilion.evaluation.take import evaluate_take, sums_of_layers, with_layer_errors
from vermilion.evaluation.truth import read_curves, read_truth
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.provenance.begun_run import begin_job
from vermilion.regression.model import load_model
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.chunks import read_chunks, read_frames
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.result import Identity, TrackedTake

CONTOURS = ("outer_px", "inner_px", "outer_found", "inner_found")


def tracked_frames(fit, asked, place):
    """(F,) bool of the frames asked for; raises InputError where none was tracked."""
    tracked = fit.valid[fit.index_of(asked)]
    if not tracked.any():
        raise InputError(
            "no tracked frame among those held out",
            "at least one",
            "See the take's tracking overlay, or set its split to `none`.",
            **place,
        )
    return tracked


def reference(snakemake, tracker, correspondence, frames, place):
    """Truth where it is given, else H, at the frames."""
    inputs = snakemake.input
    if not inputs.get("truth"):
        vertices = read_frames(inputs.accurate, frames)
        neutral = read_frames(inputs.accurate, [snakemake.params.first])[0]
        where = correspondence.vertices
        return reference_of(
            "H", where, vertices, correspondence.accurate_triangles, neutral, **place
        )
    (neutral,), triangles = read_truth(*inputs.neutral_truth, rows=np.array([0]), **place)
    near = ReferenceConfig(**snakemake.params.cfg["evaluation.reference"])
    at_rest = read_sequence(inputs.neutral_accurate)[0].astype(np.float64)
    where = truth_of_vertices(
        correspondence.vertices,
        Mesh(at_rest, correspondence.accurate_triangles),
        lip_sides(FaceModel.load(inputs.template)),
        lip_sides(tracker),
        Mesh(neutral.astype(np.float64), triangles),
        MatchTolerance(**near.model_dump()),
    )
    sequence, _ = read_truth(*inputs.truth, rows=frames - snakemake.params.first, **place)
    return reference_of("truth", where, sequence, triangles, neutral, **place)


def true_curves(snakemake, frames, place):
    """Expression weights of the frames, a dict each; None where they are not known."""
    path = snakemake.input.get("curves")
    return read_curves(path, frames - snakemake.params.first, **place) if path else None


def oracle(inputs, correspondence, take, settings, rows):
    """Meshes by the true layers, and the layers, of the `rows` of a take; None without layers."""
    if not inputs.get("layers"):
        return None, None
    mask = correspondence.mask
    given = read_chunks(inputs.layers, take.frames, ["layers", "displacement_mm", "valid"])
    with_layers = replace(take, valid=take.valid & given["valid"])
    meshes = correct_with_layers(
        mask, given["layers"], given["displacement_mm"], with_layers, settings
    )
    return meshes[rows], held_out.TrueLayers(mask, given["layers"][rows], given["valid"][rows])


def row_name(path, model, subject):
    """Name of a model's row: that of its file, or of the generic regressor for a person."""
    generic = model.name == GENERIC
    return f"GR-{subject}/{GENERIC}" if generic else measure_name(Path(path).stem)


def regressors(inputs, take, settings, rows, null, subject):
    """Name -> what each model makes of the `rows` of a take; also told the neutrals that are known."""
    regressed, loaded = {}, {path: load_model(path) for path in inputs.models}
    pairs = load_pairs(inputs.get("neutral_pair"), inputs.get("neutral_of_take"))
    models = {row_name(path, model, subject): model for path, model in loaded.items()}
    for name, model in {NULL: null, **models}.items():
        chosen = settings.as_in_the_paper() if name.endswith("/paper") else settings
        regressed[name] = held_out.Regressed.of(model, take, chosen, rows)
        known = model if "/" in name else with_known_neutrals(model, take.triangles, *pairs)
        if known is not model:
            regressed[f"{name}/neutral"] = held_out.Regressed.of(known, take, chosen, rows)
    return regressed


def told_the_neutral(tracks, take, settings, regressed):
    """`base/neutral` and `contour/neutral`: the tracks (F, V, 3) with what the neutrals correct.

    Nothing else: neither layers of the frame nor the image.
    """
    if f"{NULL}/neutral" not in regressed:
        return {}
    known = regressed[f"{NULL}/neutral"].model
    return {
        f"{name}/neutral": correct(
            known, replace(take, coarse_mm=meshes), settings.as_in_the_paper()
        )
        for name, meshes in tracks.items()
    }


def contour_track(inputs, tracker, fit, take, correspondence, contours, cfg):
    """The baseline of Lips16 section 6: lip shapes of the training, fitted to the contours."""
    seam_mm, ridge = cfg["correction.integration"]["seam_mm"], cfg["evaluation.contour"]["ridge"]
    shapes = LipShapes.load(inputs.shapes).on(
        correspondence.coarse_neutral_mm, tracker.triangles, seam_mm
    )
    # A frame whose features are not valid may have contours all the same.
    image = ImageContours(tracker, fit.camera, **contours)
    fitted = ContourTracker(tracker, shapes, image.outer_px.shape[1], ridge)
    return fitted.track(take, image, fit.weights[fit.index_of(take.frames)])


def all_sums(result, sequences, take, tracker, camera, contours, layer_errors):
    """Sums by clip of every sequence: against the reference, in the image, in the layers."""
    found_px = contours["outer_px"], contours["inner_px"]
    sums = {
        name: result.sums[name]
        + held_out.sums_of_contours(
            sequence, take.coarse_mm, tracker, camera, *found_px, result.clips
        )
        for name, sequence in sequences.items()
    }
    for name, errors in layer_errors.items():
        sums[name] += sums_of_layers(errors, result.clips)
    return sums


def surfaces(sequences, take, tracker, camera, cfg):
    """Quality of the surface of every sequence's lips, beside the base track's, by name."""
    image = ImageAgreementConfig(**cfg["correction.image"])
    tolerances = SurfaceTolerances(**cfg["evaluation.measures"]["surface"])
    lips = LipSurface(tracker, LipFolds(tracker, image.folded_deg, image.crease_deg), tolerances)
    return {
        name: lips.measure(sequence, take.coarse_mm, camera)
        for name, sequence in sequences.items()
        if name != "base"
    }


def quality_rows(asked, tracked, surface):
    """A row a frame that was asked for: not tracked, or what is wrong with the corrected lips, and of whom."""
    told = {name: of.reasons() for name, of in surface.items() if is_judged(name)}
    rows, f = [], 0
    for frame, ok in zip(asked, tracked, strict=True):
        if not ok:
            rows.append(QualityRow(int(frame), False, "not tracked, so not measured"))
            continue
        reason = "; ".join(f"{name}: {why[f]}" for name, why in told.items() if why[f])
        rows.append(QualityRow(int(frame), True, reason))
        f += 1
    return rows


def corrected_takes(inputs, tracker, fit, correspondence, cfg, frames, fps, subject):
    """The frames' coarse take, what regressors make of it, the oracle's meshes and layers, settings."""
    section = CorrectionConfig(
        integration=cfg["correction.integration"], image=cfg["correction.image"]
    )
    settings = CorrectionSettings.of(section.at(fps))
    take = CoarseTake.load(
        tracker, fit, Identity.load(inputs.identity).neutral_mm, inputs.coarse, inputs.features,
        frames, section.reach_frames(fps),
    )  # fmt: skip
    rows = np.searchsorted(take.frames, frames)
    names = read_arrays(inputs.features[0], "features", ["names"])["names"].tolist()
    null = null_model(tracker.triangles, correspondence.mask, names)
    regressed = regressors(inputs, take, settings, rows, null, subject)
    by_truth = oracle(inputs, correspondence, take, settings, rows)
    return take[rows], regressed, *by_truth, settings


def main(snakemake):
    inputs, out, cfg = snakemake.input, snakemake.output, snakemake.params.cfg
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    options = MeasuresConfig(**cfg["evaluation.measures"])
    tracker = FaceModel.load(inputs.tracker)
    correspondence = Correspondence.load(inputs.correspondence)
    fit, asked = TrackedTake.load(inputs.fit), np.array(snakemake.params.frames)
    tracked = tracked_frames(fit, asked, place)
    frames = asked[tracked]
    take, regressed, by_truth, true, settings = corrected_takes(
        inputs, tracker, fit, correspondence, cfg, frames, snakemake.params.fps, place["subject"]
    )
    contours = read_chunks(inputs.features, frames, CONTOURS)
    sequences = {"base": take.coarse_mm}
    sequences["contour"] = contour_track(inputs, tracker, fit, take, correspondence, contours, cfg)
    sequences |= told_the_neutral(sequences, take, settings, regressed)
    sequences |= {} if by_truth is None else {"oracle": by_truth}
    sequences |= {name: of_model.corrected_mm for name, of_model in regressed.items()}
    regions = regions_of_mask(tracker, correspondence.coarse_neutral_mm, correspondence.mask)
    against = reference(snakemake, tracker, correspondence, frames, place)
    result = evaluate_take(
        sequences, frames, tracker, regions, against,
        options.clip_frames, options.min_clips,
        LipTolerances(options.touch_mm, options.gape_mm, options.through_mm),
        true_curves(snakemake, frames, place),
    )  # fmt: skip

    layer_errors = {}
    if true is not None:
        layer_errors = {n: held_out.layer_errors(of, take, true) for n, of in regressed.items()}
    sums = all_sums(result, sequences, take, tracker, fit.camera, contours, layer_errors)
    surface = surfaces(sequences, take, tracker, fit.camera, cfg)
    for name, of_lips in surface.items():
        sums[name] += sums_of_surface(of_lips, result.clips)
    save_sums(out.sums, sums, len(frames))
    resampling = options.bootstrap_samples, options.confidence, options.seed
    table = measure_rows(sums, *place.values(), len(frames), *resampling)
    print(table.to_string())
    write_table(out.measures, table)
    # Apart from the measures: seconds differ from run to run, and measures must not.
    seconds = {name: of_model.seconds for name, of_model in regressed.items()}
    write_table(
        out.seconds, [{**place, "regressor": n, "seconds_per_frame": s} for n, s in seconds.items()]
    )
    write_table(out.frames, with_layer_errors(result.table, layer_errors))
    maps = held_out.shown_arrays(
        result, take, cfg["evaluation.figures.map_frames"], against,
        correspondence.coarse_neutral_mm, regions.weights["mouth"] > 0, tracker, fit.camera,
    )  # fmt: skip
    write_arrays(out.maps, compressed=True, **maps)
    rows = quality_rows(asked, tracked, surface)
    write_quality(out.quality, *place.values(), "evaluation", rows)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
