"""The face model of a subject whose eye distance was measured, in the size of their head."""

from vermilion.faces.model import FaceModel
from vermilion.provenance.begun_run import begin_job
from vermilion.tracking.identity.head_size import pupil_distance_mm, sized_model
from vermilion.tracking.identity.landmark_identity import fit_identity
from vermilion.tracking.identity.sampling import sample_takes
from vermilion.tracking.settings import identity_settings


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    tracker = FaceModel.load(inputs.tracker)
    count = cfg["tracking.identity"]["frames"]
    found = sample_takes(params.takes, inputs.landmarks, inputs.cameras, inputs.calibration, count)
    settings = identity_settings(cfg["tracking.fit"], cfg["tracking.identity"])
    person = fit_identity(tracker, [part.sample for part in found], settings).identity
    own = sized_model(tracker, person, params.eye_distance_mm)
    usual = pupil_distance_mm(tracker, tracker.neutral_of(person))
    print(
        f"pupils {params.eye_distance_mm:g} mm apart, {usual:.1f} before: {params.eye_distance_mm / usual:.3f} of its size"
    )
    own.save(snakemake.output.tracker)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
