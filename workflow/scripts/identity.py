"""The identity of a subject from landmarks of sampled frames of its takes."""

import json

import numpy as np

from vermilion.camera import read_cameras
from vermilion.faces.model import FaceModel
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.logfile import log_to
from vermilion.tracking.identity import TakeSample, fit_identity
from vermilion.tracking.observation import Observations, focal_px
from vermilion.tracking.result import Identity
from vermilion.tracking.sampling import spread_frames
from vermilion.tracking.settings import identity_settings


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    tracker, paths = FaceModel.load(inputs.tracker), iter(inputs.landmarks)
    takes = {row["take"]: row for row in snakemake.params.takes}
    tracks = {
        name: LandmarkTrack.load([next(paths) for _ in range(row["chunks"])])
        for name, row in takes.items()
    }
    chosen = spread_frames(
        {name: track.valid for name, track in tracks.items()}, cfg["tracking.identity"]["frames"]
    )
    samples = []
    for (name, row), folder, summary in zip(
        takes.items(), inputs.cameras, inputs.calibration, strict=True
    ):
        camera = read_cameras(folder)[row["camera"]]
        rows = chosen.get(name, np.zeros(0, dtype=int))
        with open(summary, encoding="utf-8") as stream:
            calibrated = bool(json.load(stream)["calibrated"])
        samples.append(
            TakeSample(
                name,
                Observations.of(tracks[name], camera)[rows],
                focal_px(camera),
                calibrated,
                tracks[name].frames[rows] == row["neutral"],
            )
        )
    settings = identity_settings(cfg["tracking.fit"], cfg["tracking.identity"])
    fit = fit_identity(tracker, samples, settings)
    print(f"identity {fit.identity.round(2)}, {fit.reprojection_px:.2f} px, focal {fit.focal_px}")
    Identity.of(fit, tracker, samples).save(snakemake.output.identity)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
