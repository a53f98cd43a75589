"""The fitted frames of a take smoothed over time: the track that all later stages use."""

from dataclasses import replace

from vermilion.storage.chunks import read_chunks
from vermilion.storage.logfile import log_to
from vermilion.tracking.image_fit.smooth_over_time import smooth_over_time
from vermilion.tracking.image_fit.take import TakeStart


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    fit, _, start = TakeStart.load(inputs, cfg)
    names = ["x", "matrix", "right", "refined"]
    found = read_chunks(inputs.chunks, fit.frames, names)
    # Weights and depth are noisier from images than from landmarks: smooth them more.
    smooth = replace(start.settings, **cfg["tracking.image_fit.join"])
    x = smooth_over_time(
        found["matrix"], found["right"], found["x"], found["refined"], snakemake.params.fps, smooth
    )
    start.with_motion(fit, x).save(snakemake.output.fit)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
