"""One light that fits all frames of a take, and the albedo of its first frames under it."""

from dataclasses import replace

from vermilion.detail.relief.frames import ReliefScene
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.light_evidence import LightEvidence, fitted_light
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.detail.relief.standing_relief import with_standing_relief
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    scene = ReliefScene.open(FaceModel.load(inputs.tracker), inputs, source, params.span, cfg)
    settings = ReliefSettings.of(cfg)
    start = ClipLight.load(inputs.start)
    light = fitted_light([LightEvidence.load(path) for path in inputs.evidence], start.light)
    first = {frame: scene.observe(frame, scene.fine(frame)) for frame in start.frames.tolist()}
    found = with_standing_relief(replace(start, light=light), scene, first, settings)
    found.save(snakemake.output.light)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
