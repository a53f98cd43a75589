"""Drift of a chunk's frames against the neutral: drift/{chunk}.tsv."""

import cv2

from vermilion.faces.model import FaceModel
from vermilion.multiview.drift import DriftSettings, NeutralImages, carry, drift_rows, unread_row
from vermilion.multiview.files import read_neutral
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.take import MultiviewImages
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import write_table


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, inputs, frames = snakemake.params.cfg, snakemake.input, snakemake.params.frames
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    settings = DriftSettings(**cfg["multiview.drift"])
    model = FaceModel.load(inputs.template)
    images = MultiviewImages.open(
        snakemake.params.source, inputs.cameras, cfg["multiview.images"], **place
    )
    neutral = read_neutral(inputs.neutral, model.n_vertices, **place)
    origin = NeutralImages.of(images.load(snakemake.params.neutral, settings.scale), neutral, model)
    meshes, matcher, rows = read_sequence(inputs.meshes), FlowMatcher(), []
    for number, mesh in progress(zip(frames, meshes, strict=True), "drift", len(frames)):
        try:
            frame = images.load(number, settings.scale)
        except InputError as error:
            rows.append(unread_row(number, str(error)))
            continue
        carried = carry(origin, frame, mesh, matcher, settings)
        rows += drift_rows(origin, frame, carried, settings.scale)
    write_table(snakemake.output.drift, [{**place, **row} for row in rows])


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
