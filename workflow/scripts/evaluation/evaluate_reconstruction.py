"""H of a tattoo take against known truth, in the rig's world, without any alignment."""

import numpy as np

from vermilion.config.evaluation import MeasuresConfig, ReferenceConfig
from vermilion.correspondence.correspondence import Correspondence
from vermilion.evaluation.files import save_sums
from vermilion.evaluation.masks import mask_on, regions_of_mask
from vermilion.evaluation.measures import measure_rows
from vermilion.evaluation.reference import (
    MatchTolerance,
    attach,
    drift,
    reference_of,
)
from vermilion.evaluation.take import evaluate_reconstruction
from vermilion.evaluation.truth import read_truth
from vermilion.evaluation.visible import cameras_that_see
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.geometry.mesh import Mesh, vertex_normals
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import frames_of, read_sequence
from vermilion.storage.tables import write_table


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    options = MeasuresConfig(**cfg["evaluation.measures"])
    near = MatchTolerance(**ReferenceConfig(**cfg["evaluation.reference"]).model_dump())
    template = FaceModel.load(inputs.template)
    correspondence = Correspondence.load(inputs.correspondence)
    triangles = template.triangles
    frames = frames_of(inputs.accurate)
    sequence = np.asarray(read_sequence(inputs.accurate), dtype=np.float64)
    finite = np.isfinite(sequence).all(axis=(1, 2))
    if not finite.any():
        raise InputError(
            "no reconstructed frame",
            "at least the neutral",
            "See multiview/report.html of the take.",
            **place,
        )
    frames, sequence = frames[finite], sequence[finite]
    truth, truth_triangles = read_truth(
        *inputs.truth, rows=frames - snakemake.params.first, **place
    )
    neutral_truth = truth[0].astype(np.float64)
    sides = lip_sides(template)
    where = attach(
        sequence[0], vertex_normals(sequence[0], triangles), sides,
        Mesh(sequence[0], triangles), sides, Mesh(neutral_truth, truth_triangles), near,
    )  # fmt: skip
    reference = reference_of("truth", where, truth, truth_triangles, **place)
    mouth = mask_on(
        sequence[0], triangles, correspondence.on_coarse(sequence[0]),
        correspondence.coarse_triangles[correspondence.mask],
    )  # fmt: skip
    regions = regions_of_mask(template, sequence[0], mouth)
    slid = drift(sequence, triangles, reference, regions.used & reference.valid, near.min_cosine)
    cameras = read_cameras(inputs.cameras).values()
    seen = cameras_that_see(reference, cameras, regions.weights["vermilion"] > 0) >= 2
    sums = evaluate_reconstruction(
        sequence, frames, regions, reference, slid, seen, options.clip_frames, options.min_clips
    )
    save_sums(snakemake.output.sums, sums, len(frames))
    table = measure_rows(
        sums, *place.values(), len(frames),
        options.bootstrap_samples, options.confidence, options.seed,
    )  # fmt: skip
    print(table.to_string())
    write_table(snakemake.output.measures, table)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
