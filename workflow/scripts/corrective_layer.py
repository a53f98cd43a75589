"""Offsets outside the model's space of the frames of a chunk."""

import numpy as np

from vermilion.errors import InputError
from vermilion.faces.model import FaceModel
from vermilion.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.logfile import log_to
from vermilion.photometric.appearance import Appearance
from vermilion.photometric.layer import CorrectiveLayer
from vermilion.photometric.settings import layer_settings
from vermilion.photometric.take import TakeStart
from vermilion.progress import progress
from vermilion.sequences import write_sequence
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import fit_settings


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    fit, appearance = TrackedTake.load(inputs.fit), Appearance.load(inputs.appearance)
    rows = fit.index_of(params.frames)
    start = TakeStart.of(
        FaceModel.load(inputs.tracker),
        Identity.load(inputs.identity),
        fit,
        LandmarkTrack.load(inputs.landmarks),
        fit_settings(cfg["tracking.fit"], cfg["tracking.motion"]),
        rows,
    )
    face, source = start.face(appearance.samples), open_frames(params.source, *place)
    settings = layer_settings(cfg["refinement.offsets"])
    layer = CorrectiveLayer(start.model, start.identity.neutral_mm, face, appearance, settings)
    pixel_mm = cfg["refinement.appearance"]["pixel_mm"]
    offsets = np.zeros((len(rows), start.model.n_vertices, 3))
    for index in progress(np.flatnonzero(fit.valid[rows]), "corrective layer"):
        try:
            picture = source.read(fit.camera.name, int(params.frames[index]))
        except InputError:
            continue  # flagged by the capture stage; the model alone, as where nothing is seen
        view = start.view(index, picture, face, pixel_mm, len(settings.iterations))
        offsets[index] = layer.solve(view)
    write_sequence(snakemake.output[0], offsets)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
