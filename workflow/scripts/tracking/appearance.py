"""Lighting and albedo of a take from well-fitted frames that differ in pose and expression."""

import numpy as np

from vermilion.appearance.samples import sample_skin
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.tracking.image_fit.appearance_frames import choose_appearance_frames
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem
from vermilion.tracking.image_fit.overlay import appearance_image
from vermilion.tracking.image_fit.take import TakeStart, learn_appearance

#: Least frames that a piece's appearance is learnt from, where it has them.
LEAST_FRAMES = 4


def frames_of_pieces(x, fit, count):
    """Piece between cuts -> rows of the frames that its appearance is learnt from: `count` over all."""
    chosen = {}
    for number in np.unique(fit.pieces[fit.valid]):
        own = fit.valid & (fit.pieces == number)
        share = int(np.ceil(count * own.sum() / fit.valid.sum()))
        rows = choose_appearance_frames(
            x, own, fit.reprojection_px, max(share, min(LEAST_FRAMES, count))
        )
        if len(rows):
            chosen[int(number)] = rows
    return chosen


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, cfg = snakemake.input, snakemake.params.cfg
    options = cfg["tracking.image_fit.appearance"]
    fit, _, start = TakeStart.load(inputs, cfg)
    chosen = frames_of_pieces(start.x, fit, options["frames"])
    if not chosen:
        raise InputError(
            "no tracked frame",
            "a face in at least one frame",
            "Look at the landmark overlays, or switch `tracking.image_fit.enabled` off.",
            subject=place[0],
            take=place[1],
        )
    samples = sample_skin(start.model, options["spacing_mm"])
    face, source = start.face(samples), open_frames(snakemake.params.source, *place)
    settings = FrameFitSettings(**cfg["tracking.image_fit.frame_fit"])
    pieces = {}
    for number, rows in chosen.items():
        views = []
        for row in rows:  # one whole image in memory at a time
            image = source.read(fit.camera.name, int(fit.frames[row]))
            view = start.view(row, image, face, options["pixel_mm"], len(settings.iterations))
            views.append(view)
        found = pieces[number] = learn_appearance(
            fit.frames[rows], views, face, samples, options["albedo_prior"], options["rounds"],
            lambda found: FrameProblem(face, found, settings, start.weight_sigmas),
        )  # fmt: skip
        light = np.round(found.light[0], 3)
        print(f"frames {found.frames}, light {light}, spread {np.median(found.spread):.2f}")
    longest = max(chosen, key=lambda number: np.count_nonzero(fit.pieces == number))
    rows, appearance = chosen[longest], pieces[longest]
    write_srgb8(
        snakemake.output.overlay,
        appearance_image(
            source.read(fit.camera.name, int(fit.frames[rows[0]])),
            start,
            start.x[rows[0]],
            appearance,
        ),
    )
    appearance.save(snakemake.output.appearance, pieces if len(pieces) > 1 else None)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
