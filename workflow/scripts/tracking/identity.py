"""The identity of a subject from landmarks of sampled frames of its takes."""

from vermilion.faces.model import FaceModel
from vermilion.provenance.begun_run import begin_job
from vermilion.tracking.identity.landmark_identity import fit_identity
from vermilion.tracking.identity.sampling import sample_takes, tells_lips
from vermilion.tracking.result import Identity
from vermilion.tracking.settings import identity_settings, own_lips_settings


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    tracker = FaceModel.load(inputs.tracker)
    count = cfg["tracking.identity"]["frames"]
    found = sample_takes(params.takes, inputs.landmarks, inputs.cameras, inputs.calibration, count)
    samples = [part.sample for part in found]
    settings = identity_settings(cfg["tracking.fit"], cfg["tracking.identity"])
    fit = fit_identity(tracker, samples, settings)
    print(f"identity {fit.identity.round(2)}, {fit.reprojection_px:.2f} px, focal {fit.focal_px}")
    own_lips = own_lips_settings(cfg["tracking.identity"], tells_lips(inputs.landmarks))
    Identity.of(fit, tracker, samples, own_lips=own_lips).save(snakemake.output.identity)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
