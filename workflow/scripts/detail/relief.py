"""Relief of each frame of a chunk from its shading."""

from dataclasses import fields

from vermilion.detail.relief.frames import ReliefScene, relief_of_frames
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.detail.relief.topology import FineTopology
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    topology = FineTopology.of(
        FaceModel.load(inputs.tracker), cfg["detail.relief.levels"], cfg["detail.relief.spacing_mm"]
    )
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    span = (params.frames[0], params.frames[-1])
    scene = ReliefScene.open(topology, inputs, source, span, cfg["detail.relief.face_px"])
    settings = ReliefSettings(
        **{f.name: cfg[f"detail.relief.{f.name}"] for f in fields(ReliefSettings)}
    )
    relief_of_frames(scene, params.frames, ClipLight.load(inputs.light), settings).save(
        snakemake.output.relief
    )


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
