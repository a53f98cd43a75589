"""Pose and weights of a take whose base is another tracker's sequence."""

import numpy as np

from vermilion.config.tracking import ExternalBaseConfig
from vermilion.external.motion import external_take
from vermilion.external.placement import place_world
from vermilion.external.weights_file import read_weights
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.json_files import load_json
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import Identity


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    options = ExternalBaseConfig(**cfg["tracking.external.base"])
    model, person = FaceModel.load(inputs.tracker), Identity.load(inputs.identity)
    track = LandmarkTrack.load(list(inputs.landmarks))
    own = read_sequence(list(inputs.coarse))
    if not np.isfinite(own).all(axis=(1, 2)).any():
        raise InputError(
            "a sequence without a mesh in the take's frames", "one frame at least",
            "Export the frames again, with the numbers of the images.", **place,
        )  # fmt: skip
    placement, camera = place_world(
        own[:, model.landmarks].astype(np.float64),
        track.points_px,
        read_cameras(inputs.cameras)[params.camera],
        calibrated=load_json(inputs.calibration)["calibrated"],
        world=options.world,
    )
    whose = "the capture's" if placement.as_given else "its own, found by the landmarks"
    print(
        f"world of the sequence: {whose}; landmarks {placement.off:.3f} inter-ocular distances off"
    )
    weights = None
    if inputs.get("weights"):
        names = list(model.expression_names)
        first = int(track.frames[0])
        _, weights = read_weights(
            inputs.weights, track.frames, names=names, first=first, fps=params.fps, **place
        )
    limit = cfg["tracking.motion.max_reprojection"]
    fit = external_take(model, own, person.neutral_mm, weights, placement, camera, track, limit)
    fit.save(snakemake.output.fit)
    placement.save(snakemake.output.placement)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
