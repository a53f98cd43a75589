"""Correspondence of a subject's coarse and accurate neutral, with its overlay and quality."""

import numpy as np

from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.correspondence.correspondence import CorrespondenceSettings
from vermilion.correspondence.neutral import NeutralFrame, correspond_neutrals, quality_of
from vermilion.correspondence.overlay import correspondence_overlay
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    inputs, output = snakemake.input, snakemake.output
    subject, take = snakemake.wildcards.subject, snakemake.params.take
    template, tracker = FaceModel.load(inputs.template), FaceModel.load(inputs.tracker)
    place = {"subject": subject, "take": take}
    accurate = read_neutral(inputs.accurate, template.n_vertices, **place).astype(np.float64)
    accurate = Mesh(accurate, template.triangles)
    coarse = Mesh(read_sequence(inputs.coarse)[0].astype(np.float64), tracker.triangles)
    fit, track = TrackedTake.load(inputs.fit), LandmarkTrack.load(inputs.landmarks)
    neutral = NeutralFrame.of(coarse, accurate, fit, track, **place)
    options = CorrespondenceConfig(**snakemake.params.cfg["correspondence"])
    settings = CorrespondenceSettings(**options.model_dump(exclude={"landmarks"}))
    found, registered, landmarks = correspond_neutrals(
        neutral, tracker, template, options.landmarks, settings
    )
    found.save(output.correspondence)
    frame = int(fit.frames[0])
    image = to_display(open_frames([inputs.image], subject, take).read("", frame))
    write_srgb8(
        output.overlay,
        correspondence_overlay(image, fit.camera, coarse, accurate, registered, landmarks, found),
    )
    row = quality_of(found, registered, accurate, frame)
    write_quality(output.quality, subject, take, "correspondence", [row])


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
