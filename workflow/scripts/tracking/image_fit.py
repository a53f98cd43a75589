"""Pose and expression of each frame of a chunk from its image."""

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.arrays import write_arrays
from vermilion.tracking.image_fit.chunk import FrameChunk, fit_frames
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem


def main(snakemake):
    params, cfg = snakemake.params, snakemake.params.cfg
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    chunk = FrameChunk.load(snakemake.input, source, cfg, params.frames)
    settings = FrameFitSettings(**cfg["tracking.image_fit.frame_fit"])
    sigmas = chunk.start.weight_sigmas
    own = Appearance.load_pieces(snakemake.input.appearance) or {0: chunk.appearance}
    problems = {
        number: FrameProblem(chunk.face, found, settings, sigmas) for number, found in own.items()
    }
    found = fit_frames(chunk, problems)
    write_arrays(snakemake.output[0], frames=np.array(params.frames), **found)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
