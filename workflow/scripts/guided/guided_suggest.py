"""Frames of a take that are worth correcting next, best first."""

import numpy as np
import pandas as pd

from vermilion.config.guided import RegionsConfig
from vermilion.faces.model import FaceModel
from vermilion.guided.regions import regions_of_face
from vermilion.guided.suggestion import mouth_deformation, suggest_frames, unexplained_share
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.result import Identity, TrackedTake


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    face, fit = FaceModel.load(inputs.face), TrackedTake.load(inputs.fit)
    regions = regions_of_face(face, **RegionsConfig(**cfg["guided.regions"]).model_dump())
    neutral = (
        Identity.load(inputs.identity).neutral_mm
        if inputs.get("identity")
        else read_neutral(inputs.neutral, face.n_vertices)
    )
    sequence = read_sequence(inputs.sequence)
    usable = np.flatnonzero(np.isfinite(sequence).all(axis=(1, 2)))
    stable = np.flatnonzero(face.regions["rigid"])
    deformation = mouth_deformation(sequence[usable], neutral, regions, stable)
    frames = fit.frames[usable]
    done = np.flatnonzero(np.isin(frames, snakemake.params.corrected))
    left = len(frames) - len(done)
    chosen = np.zeros(0, dtype=int)
    if left:
        count = min(cfg["guided.suggestion"]["count"], left)
        chosen = suggest_frames(deformation, count, done, fit.valid[usable])
    rows = []
    for rank, row in enumerate(chosen, start=1):
        spanned = np.concatenate([done, chosen[:rank]])
        share = unexplained_share(deformation, spanned).mean()
        rows.append({"rank": rank, "frame": int(frames[row]), "unexplained_after": share})
    columns = ["rank", "frame", "unexplained_after"]
    write_table(snakemake.output.table, pd.DataFrame(rows, columns=columns))
    print(f"{len(done)} frames corrected; suggested: {[row['frame'] for row in rows]}")


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
