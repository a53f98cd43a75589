"""The identity of a subject from landmarks and images of sampled frames of its takes."""

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.imaging.draw import tile
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.progress import progress
from vermilion.tracking.identity.colour_residuals import IdentityImageSettings
from vermilion.tracking.identity.joint_identity import fit_joint_identity
from vermilion.tracking.identity.landmark_identity import IdentityProblem
from vermilion.tracking.identity.sampling import sample_takes, tells_lips
from vermilion.tracking.image_fit.overlay import residual_sheet
from vermilion.tracking.image_fit.residual import photometric_residual
from vermilion.tracking.result import Identity
from vermilion.tracking.settings import identity_settings, own_lips_settings

STEPS = ("landmarks", "with images")
#: Frames of the overlay. Not a key: changing it would rerun everything that follows the identity.
SHOWN = 4


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    options, subject = cfg["tracking.identity"], snakemake.wildcards.subject
    tracker = FaceModel.load(inputs.tracker)
    found = sample_takes(
        params.takes, inputs.landmarks, inputs.cameras, inputs.calibration, options["frames"]
    )
    samples = [part.sample for part in found]
    sources = {
        row["take"]: open_frames(row["source"], subject, row["take"]) for row in params.takes
    }
    wanted = [(part, int(frame)) for part in found for frame in part.frames]
    images = [
        sources[part.sample.name].read(part.camera.name, frame)
        for part, frame in progress(wanted, "images")
    ]
    image_options = {k: v for k, v in options["images"].items() if k != "enabled"}
    joint = fit_joint_identity(
        tracker,
        IdentityProblem(tracker, samples, identity_settings(cfg["tracking.fit"], options)),
        images,
        [part.camera for part, _ in wanted],
        IdentityImageSettings(**image_options),
    )
    sheets, residuals = [], []
    for (part, frame), image, states in zip(wanted, images, joint.residuals, strict=True):
        each = [photometric_residual(errors, trust) for errors, trust, _ in states]
        labels = [f"{step} {value:.2f}" for step, value in zip(STEPS, each, strict=True)]
        row = [(text, *state) for text, state in zip(labels, states, strict=True)]
        residuals.append(each)
        sheets.append(((f"{part.sample.name} {frame}", image, row), part.camera))
    before, after = np.mean(residuals, axis=0)
    fit = joint.person
    print(f"identity {fit.identity.round(2)}, {fit.reprojection_px:.2f} px, focal {fit.focal_px}")
    print(f"residual {before:.2f} to {after:.2f} display values, {len(wanted)} frames")
    shown = evenly_spaced(len(sheets), SHOWN)
    rows = [residual_sheet([sheets[index][0]], sheets[index][1]) for index in shown]
    write_srgb8(snakemake.output.overlay, tile(rows, 1))
    own_lips = own_lips_settings(options, tells_lips(inputs.landmarks))
    Identity.of(fit, tracker, samples, own_lips=own_lips).save(snakemake.output.identity)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
