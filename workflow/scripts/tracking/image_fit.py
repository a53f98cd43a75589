"""Pose and expression of each frame of a chunk from its image."""

from vermilion.appearance.estimate import Appearance
from vermilion.imaging.frames import open_frames
from vermilion.storage.arrays import write_arrays
from vermilion.storage.logfile import log_to
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem
from vermilion.tracking.image_fit.take import TakeStart, fit_frames


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    appearance = Appearance.load(inputs.appearance)
    fit, rows, start = TakeStart.load(inputs, cfg, params.frames)
    face, source = start.face(appearance.samples), open_frames(params.source, *place)
    settings = FrameFitSettings(**cfg["tracking.image_fit.frame_fit"])
    problem = FrameProblem(face, appearance, settings, start.settings.weight_sigma)
    refined = fit_frames(
        start,
        fit.valid[rows],
        lambda index: source.read(fit.camera.name, int(params.frames[index])),
        problem,
        cfg["tracking.image_fit.appearance"]["pixel_mm"],
    )
    write_arrays(snakemake.output[0], frames=fit.frames[rows], **refined)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
