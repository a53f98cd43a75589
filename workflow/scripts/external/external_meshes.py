"""C of a chunk whose base is another tracker's sequence: in the world of the capture, with an overlay."""

from dataclasses import replace

from vermilion.external.motion import placed_meshes
from vermilion.external.placement import Placement
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.overlay import tracking_overlay
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.validity import quality_rows


def reasons_of(path):
    """Frame -> why the sequence lost it."""
    table = read_table(path, ["frame", "valid", "reason"])
    lost = table[table["valid"] == 0]
    return dict(zip(lost["frame"].astype(int), lost["reason"], strict=True))


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    inputs, frames = snakemake.input, snakemake.params.frames
    model, fit = FaceModel.load(inputs.tracker), TrackedTake.load(inputs.fit)
    rows = fit.index_of(frames)
    vertices = placed_meshes(
        model, fit, rows, read_sequence(inputs.coarse), Identity.load(inputs.identity).neutral_mm,
        Placement.load(inputs.placement),
    )  # fmt: skip
    source = open_frames(snakemake.params.source, subject, take)
    landmarks = LandmarkTrack.load(inputs.landmarks)
    count = snakemake.params.cfg["tracking.meshes"]["overlay_frames"]
    image = tracking_overlay(source, model, fit, frames, vertices, landmarks, count)
    write_srgb8(snakemake.output.overlay, image)
    lost = reasons_of(inputs.quality)
    quality = [
        replace(row, reason=lost[row.frame]) if row.frame in lost else row
        for row in quality_rows(fit, rows)
    ]
    write_quality(snakemake.output.quality, subject, take, "tracking", quality)
    write_sequence(snakemake.output.meshes, vertices)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
