"""Correct the coarse meshes of a chunk by six-frame flow; residuals and a checkerboard."""

from functools import cache

from vermilion.detail.flow.chunk import correct_frames, neighbouring_frames
from vermilion.detail.flow.deformation import DeformationSettings
from vermilion.detail.flow.frame import FlowCorrection, FlowCorrectionSettings
from vermilion.detail.flow.overlay import checkerboard_sheet
from vermilion.detail.flow.six_frame_flow import FlowSettings
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence, rows_of_frames, write_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    model, fit = FaceModel.load(inputs.tracker), TrackedTake.load(inputs.fit)
    camera, rows = fit.camera, {int(frame): row for row, frame in enumerate(fit.frames)}
    source = open_frames(params.source, subject, take)
    first, last = params.span
    places = rows_of_frames(inputs.coarse, range(first, last + 1))

    def read_image(frame):
        return source.read(camera.name, frame)

    def read_mesh(frame):
        path, row = places[frame]
        return read_sequence(path)[row]

    settings = FlowCorrectionSettings(
        cfg["detail.face_px"],
        FlowSettings(**cfg["detail.flow"]),
        DeformationSettings(**cfg["detail.deformation"]),
    )

    @cache
    def correction_of_piece(piece):
        # Each piece between cuts has the texture of its own first frame.
        start = int(fit.frames[fit.valid & (fit.pieces == piece)][0])
        return FlowCorrection(model, camera, read_image(start), read_mesh(start), settings)

    def correction_of(frame):
        if not fit.valid[rows[frame]]:
            raise InputError(
                "a frame that was not tracked", "the face", "See the landmarks' quality."
            )
        return correction_of_piece(int(fit.pieces[rows[frame]]))

    chunk = correct_frames(
        correction_of,
        params.frames,
        lambda frame: neighbouring_frames(frame, fit.frames, fit.valid, fit.pieces),
        read_image,
        read_mesh,
    )
    before = [read_mesh(frame) for frame in params.frames]
    image = checkerboard_sheet(
        read_image, camera, model, params.frames, before, chunk.vertices_mm,
        cfg["detail.overlay_frames"],
    )  # fmt: skip
    write_srgb8(snakemake.output.overlay, image)
    write_quality(snakemake.output.quality, subject, take, "detail", chunk.quality())
    for path, values in (
        (snakemake.output.start, chunk.before),
        (snakemake.output.flow, chunk.after),
    ):
        rows = [{"frame": f, "residual": v} for f, v in zip(chunk.frames, values, strict=True)]
        write_table(path, rows)
    write_sequence(snakemake.output.meshes, chunk.vertices_mm)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
