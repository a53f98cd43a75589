"""The neutral of a subject on another tracker's topology."""

import numpy as np

from vermilion.external.motion import neutral_in_head
from vermilion.faces.model import FaceModel
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.chunks import read_frames
from vermilion.storage.errors import InputError
from vermilion.tracking.result import Identity


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    model = FaceModel.load(inputs.model)
    place = {"subject": snakemake.wildcards.subject, "take": params.take, "frame": params.frame}
    own = read_frames([inputs.coarse], [params.frame])[0].astype(np.float64)
    if len(own) != model.n_vertices:
        raise InputError(
            f"a mesh of {len(own)} vertices",
            f"{model.n_vertices}, as the tracker's other sequences have",
            "Export all sequences of a run on one topology.",
            **place,
        )
    if not np.isfinite(own).all():
        raise InputError(
            "no mesh of the neutral",
            "one in the frame that shows the neutral face",
            "Export this frame again, or start the take at another one.",
            **place,
        )
    Identity(
        identity=np.zeros(0),
        neutral_mm=neutral_in_head(model, own),
        landmark_offset_mm=np.zeros((len(model.landmarks), 3)),
        takes=np.array([params.take], dtype=str),
        focal_px=np.zeros(1),
        calibrated=np.ones(1, dtype=bool),
    ).save(snakemake.output.identity)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
