"""Corrected meshes and the overlay of a chunk of a take."""

import numpy as np

from vermilion.baselines.null import NAME as NULL
from vermilion.baselines.null import null_model
from vermilion.config.apply import OverlayConfig
from vermilion.config.correction import CorrectionConfig, ImageAgreementConfig
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, correct
from vermilion.correction.folds import LipFolds
from vermilion.correction.neutral_pair import load_pairs, with_known_neutrals
from vermilion.correction.surface_quality import LipSurface, SurfaceTolerances, surface_figures
from vermilion.correspondence.correspondence import CorrespondenceSettings
from vermilion.correspondence.neutral import model_mouth_mask
from vermilion.export.shots import framing, overlay_frames
from vermilion.faces.model import FaceModel
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.video import write_video
from vermilion.provenance.begun_run import begin_job
from vermilion.regression.model import load_model
from vermilion.storage.arrays import read_arrays
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.result import Identity, TrackedTake


def quality_row(frame, tracked, has_features, figures, surface):
    """What a user should know of a frame; one outside the training's span, or with torn lips, stays valid."""
    if not tracked:
        return QualityRow(frame, False, "not tracked: the neighbours' pose, uncorrected", figures)
    if not has_features:
        return QualityRow(frame, False, "no contour features: the base track, uncorrected", figures)
    outside = figures["novelty"] > figures["novelty_limit"]
    reasons = ["outside the training's span" if outside else "", surface]
    return QualityRow(frame, True, "; ".join(filter(None, reasons)), figures)


def corrected_take(inputs, tracker, fit, cfg, frames, fps):
    """The frames' coarse take, their corrected meshes (F, V, 3), and the regressor; `null` where none is asked for."""
    options = CorrectionConfig(
        integration=cfg["correction.integration"], image=cfg["correction.image"]
    )
    take = CoarseTake.load(
        tracker, fit, Identity.load(inputs.identity).neutral_mm, inputs.coarse, inputs.features,
        frames, options.reach_frames(fps),
    )  # fmt: skip
    if inputs.model:
        pairs = load_pairs(inputs.get("neutral_pair"), inputs.get("neutral_of_take"))
        model = with_known_neutrals(load_model(inputs.model), tracker.triangles, *pairs)
    else:
        region = CorrespondenceConfig(**cfg["correspondence"]).model_dump(exclude={"landmarks"})
        mask = model_mouth_mask(tracker, take.neutral_mm, CorrespondenceSettings(**region))
        names = read_arrays(inputs.features[0], "features", ["names"])["names"].tolist()
        model = null_model(tracker.triangles, mask, names)
    corrected = correct(model, take, CorrectionSettings.of(options.at(fps)))
    asked = np.searchsorted(take.frames, frames)
    return take[asked], corrected[asked], model


def novelty_of(model, take):
    """Novelty (F,) of each frame and its limit; NaN without features, and where nothing was learnt."""
    novelty = np.full(len(take), np.nan)
    if model.name == NULL:
        return novelty, np.nan
    known = np.isfinite(take.features).all(axis=1)
    novelty[known] = model.novelty(take.features[known], take.neutral_mm)
    return novelty, model.novelty_limit


def lip_surface(tracker, cfg):
    """What measures the surface of the lips."""
    image = ImageAgreementConfig(**cfg["correction.image"])
    folds = LipFolds(tracker, image.folded_deg, image.crease_deg)
    return LipSurface(tracker, folds, SurfaceTolerances(**cfg["evaluation.measures.surface"]))


def main(snakemake):
    inputs, params, out = snakemake.input, snakemake.params, snakemake.output
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    frames, overlay = params.frames, OverlayConfig(**params.cfg["apply.overlay"])
    tracker, fit = FaceModel.load(inputs.tracker), TrackedTake.load(inputs.fit)
    take, corrected, model = corrected_take(inputs, tracker, fit, params.cfg, frames, params.fps)
    # The image shows what the file holds: beyond its precision, sums differ from run to run.
    corrected = corrected.astype(np.float32).astype(np.float64)
    write_sequence(out.corrected, corrected)

    has_features = np.isfinite(take.features).all(axis=1)
    novelty, novelty_limit = novelty_of(model, take)
    moved = np.linalg.norm(corrected - take.coarse_mm, axis=2).max(axis=1)
    lips = lip_surface(tracker, params.cfg).measure(corrected, take.coarse_mm, fit.camera)
    surface = lips.reasons()
    rows_of_quality = [
        quality_row(
            int(frame), bool(take.valid[i]), bool(has_features[i]),
            {
                "novelty": novelty[i],
                "novelty_limit": novelty_limit,
                "largest_correction_mm": moved[i],
                **surface_figures(lips, i),
            },
            surface[i],
        )
        for i, frame in enumerate(frames)
    ]  # fmt: skip
    write_quality(out.quality, *place, "apply", rows_of_quality)

    source, camera = open_frames(params.source, *place), fit.camera
    view = framing(tracker, take.neutral_mm, fit, overlay.margin, overlay.panel_height_px)
    after = "with contours" if model.name == NULL else f"corrected, {model.name}"
    images = overlay_frames(
        view, camera, lambda frame: to_display(source.read(params.camera, frame)), frames,
        fit.index_of(frames), take.valid,
        [("base track", take.coarse_mm), (after, corrected)],
        overlay.opacity, "/".join(place),
    )  # fmt: skip
    write_video(out.overlay, progress(images, "overlay", len(frames)), params.fps)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
