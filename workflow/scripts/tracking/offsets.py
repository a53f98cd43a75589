"""Offsets outside the model's space of the frames of a chunk."""

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.imaging.frames import open_frames
from vermilion.storage.logfile import log_to
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.image_fit.take import TakeStart, read_valid_frames
from vermilion.tracking.offsets import OffsetSettings, OffsetSolver


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    appearance = Appearance.load(inputs.appearance)
    fit, rows, start = TakeStart.load(inputs, cfg, params.frames)
    face, source = start.face(appearance.samples), open_frames(params.source, *place)
    options = {k: v for k, v in cfg["tracking.offsets"].items() if k != "enabled"}
    settings = OffsetSettings(**options)
    layer = OffsetSolver(start.model, start.identity.neutral_mm, face, appearance, settings)
    pixel_mm = cfg["tracking.image_fit.appearance"]["pixel_mm"]
    offsets = np.zeros((len(rows), start.model.n_vertices, 3))

    def read(index: int) -> np.ndarray:
        return source.read(fit.camera.name, int(params.frames[index]))

    # A frame that cannot be read keeps the model alone, as where nothing is seen.
    for index, image in read_valid_frames(fit.valid[rows], read, "corrective layer"):
        view = start.view(index, image, face, pixel_mm, len(settings.iterations))
        offsets[index] = layer.solve(view)
    write_sequence(snakemake.output[0], offsets)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
