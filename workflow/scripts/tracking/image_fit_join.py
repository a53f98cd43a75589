"""The fitted frames of a take smoothed over time: the track that all later stages use."""

from dataclasses import replace

from vermilion.capture.video_facts import uneven_times
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.chunks import read_chunks
from vermilion.tracking.image_fit.smooth_over_time import smooth_over_time
from vermilion.tracking.image_fit.take import TakeStart
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.timeline import Timeline


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    fit, _, start = TakeStart.load(inputs, cfg)
    names = ["x", "matrix", "right", "refined"]
    found = read_chunks(inputs.chunks, fit.frames, names)
    # Weights and depth are noisier from images than from landmarks: smooth them more.
    smooth = replace(start.settings, **cfg["tracking.image_fit.join"])
    refined, times = found["refined"], uneven_times(inputs.get("video"), fit.frames)
    timeline = Timeline.of(len(fit.frames), snakemake.params.fps, fit.pieces, times)
    shape, weights = start.landmark_shape(), found["x"][:, N_POSE:]
    x = smooth_over_time(
        found["matrix"],
        found["right"],
        found["x"],
        refined,
        smooth.smoothness(shape, timeline, refined, weights),
    )
    start.with_motion(fit, x).save(snakemake.output.fit)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
