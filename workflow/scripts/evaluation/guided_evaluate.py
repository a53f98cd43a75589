"""What guided correction leaves of a true take, against the number of corrected frames."""

import numpy as np

from vermilion.config.evaluation import MeasuresConfig
from vermilion.config.guided import GuidedStudyConfig, RegionsConfig
from vermilion.evaluation.guided_study import PropagationStudy, StudyPlan, study_rows
from vermilion.evaluation.statistics import Resampling, clips_of
from vermilion.faces.model import FaceModel
from vermilion.guided.regions import regions_of_face
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job
from vermilion.report.guided_curve import draw_guided_curve
from vermilion.report.guided_sheet import draw_guided_sheet
from vermilion.storage.arrays import read_array
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import write_table

#: Corrected frames of figure 12.
SHEET_COUNTS = (1, 3, 5, 10)


def neutral_of(inputs, n_vertices):
    """The person's neutral (V, 3): of H, or the true one."""
    if str(inputs.neutral).endswith(".npz"):
        return read_neutral(inputs.neutral, n_vertices)
    return read_array(inputs.neutral, "neutral").astype(np.float64)


def main(snakemake):
    inputs, out, cfg = snakemake.input, snakemake.output, snakemake.params.cfg
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    options = MeasuresConfig(**cfg["evaluation.measures"])
    chosen = GuidedStudyConfig(**cfg["guided.study"])
    face = FaceModel.load(inputs.face)
    regions = regions_of_face(face, **RegionsConfig(**cfg["guided.regions"]).model_dump())
    sequence = read_sequence(inputs.sequence)
    usable = np.flatnonzero(np.isfinite(sequence).all(axis=(1, 2)))
    neutral = neutral_of(inputs, face.n_vertices)
    stable = np.flatnonzero(face.regions["rigid"])
    study = PropagationStudy(np.asarray(sequence)[usable], neutral, regions, stable)
    clips = clips_of(usable, options.clip_frames, options.min_clips)
    plan = StudyPlan(chosen.counts, chosen.choices, chosen.draws, chosen.seed)
    resampling = Resampling.of(
        int(clips.max()) + 1, options.bootstrap_samples, options.seed, options.confidence
    )
    table = study_rows(study, clips, place, plan, resampling)
    print(table.to_string())
    write_table(out.measures, table)
    counts = [count for count in SHEET_COUNTS if count < len(usable) // 2]
    print(f"Hausdorff distances, mm: {draw_guided_sheet(study, counts, stable, out.sheet)}")
    draw_guided_curve(table, f"{'/'.join(place)}: {len(usable)} frames", out.figure)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
