"""What each frame of a chunk tells of the take's light, on the mesh with relief."""

from vermilion.detail.relief.frames import ReliefScene
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.light_evidence import LightEvidence, frame_evidence
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    span = (params.frames[0], params.frames[-1])
    scene = ReliefScene.open(FaceModel.load(inputs.tracker), inputs, source, span, cfg)
    settings = ReliefSettings.of(cfg)
    start, fit = ClipLight.load(inputs.start), TrackedTake.load(inputs.fit)
    # After a cut the light may be another one: that of the first piece counts, as before.
    lit = set(fit.frames[fit.valid & (fit.pieces == fit.pieces[0])].tolist())
    found = []
    for frame in progress([f for f in params.frames if f in lit], "light"):
        try:
            observed = scene.observe_relief(frame, start, settings)
        except (InputError, ValueError):  # no image, or the face is not in it
            continue
        found.append((frame, *frame_evidence(observed, start)))
    LightEvidence.of(found).save(snakemake.output.evidence)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
