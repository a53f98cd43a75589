"""Offsets outside the model's space of the frames of a chunk."""

import numpy as np

from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.image_fit.chunk import FrameChunk
from vermilion.tracking.offsets import OffsetSettings, OffsetSolver


def main(snakemake):
    params, cfg = snakemake.params, snakemake.params.cfg
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    chunk = FrameChunk.load(snakemake.input, source, cfg, params.frames)
    options = {k: v for k, v in cfg["tracking.offsets"].items() if k != "enabled"}
    settings, start = OffsetSettings(**options), chunk.start
    solver = OffsetSolver(
        start.model, start.identity.neutral_mm, chunk.face, chunk.appearance, settings
    )
    # Frames that cannot be read keep offsets of zero, as vertices that no image shows do.
    offsets = np.zeros((len(params.frames), start.model.n_vertices, 3))
    for row, view in chunk.views(len(settings.iterations), "vertex offsets"):
        offsets[row] = solver.solve(view)
    write_sequence(snakemake.output[0], offsets)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
