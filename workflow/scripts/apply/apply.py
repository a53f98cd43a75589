"""Corrected meshes and the overlay of a chunk of a take."""

import numpy as np

from vermilion.config.apply import OverlayConfig
from vermilion.config.correction import CorrectionConfig
from vermilion.correction.correct import correct_sequence
from vermilion.correction.image_contours import (
    IMAGE_ARRAYS,
    ImageContours,
    ImageContourSettings,
    frames_around,
)
from vermilion.correction.neutral_pair import acquainted, neutral_pairs
from vermilion.export.shots import framing, overlay_frames
from vermilion.faces.model import FaceModel
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.video import write_video
from vermilion.regression.model import load_model
from vermilion.storage.chunks import read_chunks, read_frames
from vermilion.storage.logfile import log_to
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import frames_of, write_sequence
from vermilion.tracking.result import Identity, TrackedTake


def quality_row(frame, tracked, has_features, figures):
    """What a user should know of a frame; one outside the training's span stays valid."""
    if not tracked:
        return QualityRow(frame, False, "not tracked: the neighbours' pose, uncorrected", figures)
    if not has_features:
        return QualityRow(frame, False, "no contour features: the base track, uncorrected", figures)
    outside = figures["novelty"] > figures["novelty_limit"]
    return QualityRow(frame, True, "outside the training's span" if outside else "", figures)


def main(snakemake):
    inputs, params, out = snakemake.input, snakemake.params, snakemake.output
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    frames, overlay = params.frames, OverlayConfig(**params.cfg["apply.overlay"])
    tracker, model = FaceModel.load(inputs.tracker), load_model(inputs.model)
    model = acquainted(model, tracker.triangles, *neutral_pairs(inputs))
    identity, fit = Identity.load(inputs.identity), TrackedTake.load(inputs.fit)
    settings = CorrectionConfig(
        integration=params.cfg["correction.integration"], image=params.cfg["correction.image"]
    )
    near = frames_around(frames, frames_of(inputs.coarse), settings.reach_frames(params.fps))
    given = read_chunks(inputs.features, near, ["features", *IMAGE_ARRAYS])
    features = np.where(given["valid"][:, None], given["features"], np.nan)
    coarse = np.asarray(read_frames(inputs.coarse, near), dtype=np.float64)
    pose, rows = (
        (fit.world_from_head_rotation, fit.world_from_head_translation_mm),
        fit.index_of(near),
    )
    image = ImageContours.of(
        tracker, fit.camera, near, given, ImageContourSettings(**params.cfg["correction.image"])
    )
    corrected = correct_sequence(
        model, coarse, tracker.triangles, identity.neutral_mm, pose[0][rows], pose[1][rows],
        features, valid=fit.valid[rows], frames=near, image=image,
        **settings.integration.at(params.fps),
    )  # fmt: skip
    asked = np.searchsorted(near, frames)
    coarse, corrected, features, rows = (a[asked] for a in (coarse, corrected, features, rows))
    has_features, tracked = np.isfinite(features).all(axis=1), fit.valid[rows]
    # The image shows what the file holds: beyond its precision, sums differ from run to run.
    corrected = corrected.astype(np.float32).astype(np.float64)
    write_sequence(out.corrected, corrected)

    novelty = np.full(len(frames), np.nan)
    novelty[has_features] = model.novelty(features[has_features], identity.neutral_mm)
    moved = np.linalg.norm(corrected - coarse, axis=2).max(axis=1)
    rows_of_quality = [
        quality_row(
            int(frame), bool(tracked[i]), bool(has_features[i]),
            {
                "novelty": novelty[i],
                "novelty_limit": model.novelty_limit,
                "largest_correction_mm": moved[i],
            },
        )
        for i, frame in enumerate(frames)
    ]  # fmt: skip
    write_quality(out.quality, *place, "apply", rows_of_quality)

    source, camera = open_frames(params.source, *place), fit.camera
    view = framing(
        tracker, identity.neutral_mm, *pose, fit.valid, camera, overlay.margin,
        overlay.panel_height_px,
    )  # fmt: skip
    images = overlay_frames(
        view, camera, lambda frame: to_display(source.read(params.camera, frame)), frames, rows,
        tracked, [("base track", coarse), (f"corrected, {model.name}", corrected)],
        overlay.opacity, "/".join(place),
    )  # fmt: skip
    write_video(out.overlay, progress(images, "overlay", len(frames)), params.fps)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
