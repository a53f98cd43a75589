"""A chunk of a sequence with the inner lips that its corrected frames ask for, and its overlay."""

import numpy as np

from vermilion.config.apply import OverlayConfig
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.export.shots import framing, overlay_frames, with_surface_of
from vermilion.faces.model import FaceModel
from vermilion.guided.propagation import LipPropagator
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import write_video
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.chunks import read_frames
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.result import Identity, TrackedTake

#: Lips that pass through each other by more are reported.
DEPTH_MM = 0.05


def quality_row(frame, tracked, finite, figures):
    """What a user should know of a frame; one outside the corrected frames' span stays valid."""
    if not finite:
        return QualityRow(frame, False, "no mesh: left as it was", figures)
    if not tracked:
        return QualityRow(frame, False, "not tracked: the neighbours' pose", figures)
    if figures["depth_mm"] > DEPTH_MM:
        return QualityRow(frame, True, "one lip passes through the other", figures)
    outside = figures["novelty"] > figures["novelty_limit"]
    return QualityRow(frame, True, "outside the corrected frames' span" if outside else "", figures)


def corrected_chunk(model, face, meshes, contact):
    """Corrected meshes (F, V, 3); unexplained share and depth (F,), NaN where there is no mesh."""
    finite = np.isfinite(meshes).all(axis=(1, 2))
    found = model.correct(meshes[finite], LipCrossings(face) if contact else None)
    result, novelty, depth = meshes.copy(), *np.full((2, len(meshes)), np.nan)
    result[finite] = found.vertices_mm
    novelty[finite], depth[finite] = found.unexplained, found.depth_mm
    return result, novelty, depth


def panels(snakemake, face, fit, meshes, shown):
    """Images of the overlay; the frame `shown` is written as an image of its own."""
    inputs, params = snakemake.input, snakemake.params
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    options = OverlayConfig(**params.cfg["apply.overlay"])
    view = framing(
        FaceModel.load(inputs.tracker), Identity.load(inputs.identity).neutral_mm, fit,
        options.margin, options.panel_height_px,
    )  # fmt: skip
    source, rows = open_frames(params.source, *place), fit.index_of(params.frames)
    images = overlay_frames(
        with_surface_of(view, face), fit.camera,
        lambda frame: to_display(source.read(params.camera, frame)), params.frames, rows,
        fit.valid[rows], meshes, options.opacity, "/".join(place),
    )  # fmt: skip
    for index, image in enumerate(images):
        if index == shown:
            write_srgb8(snakemake.output.overlay, image)
        yield image


def main(snakemake):
    inputs, params, out = snakemake.input, snakemake.params, snakemake.output
    face, fit = FaceModel.load(inputs.face), TrackedTake.load(inputs.fit)
    meshes = read_frames([inputs.sequence], params.frames).astype(np.float64)
    model = LipPropagator.load(inputs.model)
    corrected, novelty, depth = corrected_chunk(model, face, meshes, params.cfg["guided.contact"])
    # The image shows what the file holds.
    corrected = corrected.astype(np.float32).astype(np.float64)
    write_sequence(out.corrected, corrected)
    moved = np.linalg.norm(corrected - meshes, axis=2).max(axis=1)
    rows = fit.index_of(params.frames)
    quality = [
        quality_row(
            int(frame), bool(fit.valid[rows[i]]), bool(np.isfinite(moved[i])),
            {
                "novelty": novelty[i],
                "novelty_limit": params.cfg["guided.propagation.novelty_limit"],
                "largest_correction_mm": moved[i],
                "depth_mm": depth[i],
            },
        )
        for i, frame in enumerate(params.frames)
    ]  # fmt: skip
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    write_quality(out.quality, *place, "guided", quality)
    largest = int(np.nan_to_num(moved, nan=-1.0).argmax())
    pairs = [(params.sequence, meshes), ("guided", corrected)]
    images = panels(snakemake, face, fit, pairs, largest)
    write_video(out.video, progress(images, "overlay", len(params.frames)), params.fps)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
