"""Lip shapes of the training takes, for the contour baseline (Lips16 6)."""

from functools import reduce

import numpy as np

from vermilion.baselines.lip_shapes import PosedTake, choose_lip_shapes
from vermilion.correspondence.correspondence import Correspondence
from vermilion.faces.model import FaceModel
from vermilion.multiview.lost_frames import failed_frames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.arrays import read_arrays
from vermilion.storage.chunks import read_frames
from vermilion.storage.progress import progress


def posed(take, chunks, bad, neutral, correspondence):
    """The frames of a take that train and were reconstructed."""
    frames = np.array([frame for frame in take["train"] if frame not in bad], dtype=int)
    at_rest = read_arrays(neutral, f"neutral of {take['take']}", ("vertices_mm",))["vertices_mm"]
    return PosedTake.of(take["take"], frames, read_frames(chunks, frames), at_rest, correspondence)


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    people = dict(
        zip(params.subjects, map(Correspondence.load, inputs.correspondence), strict=True)
    )
    files = [iter(inputs[name]) for name in ("accurate", "accurate_quality", "drift")]
    takes = []
    for take, neutral in progress(list(zip(params.takes, inputs.neutrals, strict=True)), "takes"):
        chunks, *told = ([next(paths) for _ in range(take["chunks"])] for paths in files)
        bad = failed_frames(*told, params.cfg["multiview.lost"])
        takes.append(posed(take, chunks, bad, neutral, people[take["take"].split("/")[0]]))
    model = FaceModel.load(inputs.tracker)
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    mask = reduce(np.intersect1d, (person.mask for person in people.values()))
    count = params.cfg["evaluation.contour"]["shapes"]
    shapes = choose_lip_shapes(takes, lips, mask, model.triangles, count)
    for take, frame in zip(shapes.take, shapes.frame, strict=True):
        print(f"{take}, frame {frame}")
    shapes.save(snakemake.output.shapes)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
