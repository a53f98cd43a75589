"""Lighting and albedo of a take from well-fitted frames that differ in pose and expression."""

import numpy as np

from vermilion.appearance.samples import sample_skin
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.storage.errors import InputError
from vermilion.storage.logfile import log_to
from vermilion.tracking.image_fit.appearance_frames import choose_appearance_frames
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem
from vermilion.tracking.image_fit.overlay import appearance_image
from vermilion.tracking.image_fit.take import TakeStart, learn_appearance


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, cfg = snakemake.input, snakemake.params.cfg
    options = cfg["tracking.image_fit.appearance"]
    fit, _, start = TakeStart.load(inputs, cfg)
    rows = choose_appearance_frames(start.x, fit.valid, fit.reprojection_px, options["frames"])
    if len(rows) == 0:
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
    views = []
    for row in rows:  # one whole image in memory at a time
        image = source.read(fit.camera.name, int(fit.frames[row]))
        views.append(start.view(row, image, face, options["pixel_mm"], len(settings.iterations)))
    appearance = learn_appearance(
        fit.frames[rows], views, face, samples, options["albedo_prior"], options["rounds"],
        lambda found: FrameProblem(face, found, settings, start.weight_sigmas),
    )  # fmt: skip
    light = np.round(appearance.light[0], 3)
    print(f"frames {appearance.frames}, light {light}, spread {np.median(appearance.spread):.2f}")
    write_srgb8(
        snakemake.output.overlay,
        appearance_image(
            source.read(fit.camera.name, int(fit.frames[rows[0]])),
            start,
            start.x[rows[0]],
            appearance,
        ),
    )
    appearance.save(snakemake.output.appearance)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
