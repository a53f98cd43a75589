"""Relief of each frame of a chunk from its shading."""

from vermilion.detail.relief.frames import ReliefScene, relief_of_frames
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    span = (params.frames[0], params.frames[-1])
    scene = ReliefScene.open(FaceModel.load(inputs.tracker), inputs, source, span, cfg)
    settings = ReliefSettings.of(cfg)
    relief_of_frames(scene, params.frames, ClipLight.load(inputs.light), settings).save(
        snakemake.output.relief
    )


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
