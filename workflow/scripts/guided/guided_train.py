"""The reduced regression of a take, from its corrected frames (Guided18 section 4)."""

import numpy as np

from vermilion.config.guided import PropagationConfig, RegionsConfig
from vermilion.faces.model import FaceModel
from vermilion.guided.propagation import LipPropagator
from vermilion.guided.refined_frame import RefinedFrame, stacked
from vermilion.guided.regions import regions_of_face
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job
from vermilion.tracking.result import Identity


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    keys = ("predict", "with_neutral", "follow_mm")
    options = PropagationConfig(**{key: cfg[f"guided.propagation.{key}"] for key in keys})
    face = FaceModel.load(inputs.face)
    regions = regions_of_face(face, **RegionsConfig(**cfg["guided.regions"]).model_dump())
    neutral = (
        Identity.load(inputs.identity).neutral_mm
        if inputs.get("identity")
        else read_neutral(inputs.neutral, face.n_vertices)
    )
    corrected, base = stacked([RefinedFrame.load(path) for path in inputs.refined])
    stable = np.flatnonzero(face.regions["rigid"])
    predict = options.predict
    if predict == "auto":
        # The chin and the cheeks of a track are at a wrong depth, those of H are not.
        predict = "mouth" if inputs.get("identity") else "change"
    propagator = LipPropagator(neutral, regions, stable, options.follow_mm)
    propagator.fit(
        corrected, base, change=predict != "lips", with_neutral=options.with_neutral,
        whole=predict == "mouth",
    )  # fmt: skip
    print(
        f"{len(corrected)} corrected frames, {len(regions.trusted)} trusted and "
        f"{len(regions.predicted)} predicted triangles"
    )
    propagator.save(snakemake.output.model)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
