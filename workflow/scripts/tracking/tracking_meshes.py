"""The coarse meshes of a chunk in the world, their quality rows, and an overlay."""

from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.tracking.overlay import tracking_overlay
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.validity import quality_rows


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    inputs, frames = snakemake.input, snakemake.params.frames
    tracker, fit = FaceModel.load(inputs.tracker), TrackedTake.load(inputs.fit)
    rows = fit.index_of(frames)
    offsets = read_sequence(inputs.offsets) if inputs.get("offsets") else None
    vertices = fit.vertices_mm(tracker, Identity.load(inputs.identity), rows, offsets)
    source = open_frames(snakemake.params.source, subject, take)
    landmarks = LandmarkTrack.load(inputs.landmarks)
    count = snakemake.params.cfg["tracking.meshes"]["overlay_frames"]
    image = tracking_overlay(source, tracker, fit, frames, vertices, landmarks, count)
    write_srgb8(snakemake.output.overlay, image)
    write_quality(snakemake.output.quality, subject, take, "tracking", quality_rows(fit, rows))
    write_sequence(snakemake.output.meshes, vertices)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
