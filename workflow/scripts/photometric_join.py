"""The refined frames of a take, smooth over time, as the track that all later stages use."""

from vermilion.chunks import read_chunks
from vermilion.logfile import log_to
from vermilion.photometric.join import join_frames
from vermilion.photometric.take import TakeStart


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    fit, _, start = TakeStart.load(inputs, cfg)
    names = ["x", "matrix", "right", "refined"]
    found = read_chunks(inputs.chunks, fit.frames, names)
    x = join_frames(
        found["matrix"], found["right"], found["x"], found["refined"], snakemake.params.fps,
        start.settings,
    )  # fmt: skip
    start.with_motion(fit, x).save(snakemake.output.fit)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
