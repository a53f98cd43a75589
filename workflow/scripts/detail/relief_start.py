"""Light, albedo and noise of a take from its first frames, and the topology of its relief."""

from vermilion.detail.relief.frames import ReliefScene
from vermilion.detail.relief.light import estimate_light
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.detail.relief.standing_relief import with_standing_relief
from vermilion.export.objs import write_obj
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    model = FaceModel.load(inputs.tracker)
    first = params.span[0]
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    source = open_frames(params.source, *place)
    scene = ReliefScene.open(model, inputs, source, params.span, cfg)
    fit, count = TrackedTake.load(inputs.fit), cfg["detail.relief.light_frames"]
    frames, seen = fit.frames[fit.valid & (fit.pieces == fit.pieces[0])][:count].tolist(), {}
    for frame in frames:
        try:
            seen[frame] = scene.observe(frame, scene.fine(frame))
        except (InputError, ValueError):  # no image, or the face is not in it
            continue
    if not any(observed.trust.any() for observed in seen.values()):
        raise InputError(
            f"no face in the first frames, {', '.join(map(str, frames)) or 'none of which was tracked'}",
            "a first frame that shows the face",
            "Begin the take where the face is seen, or raise detail.relief.light_frames.",
            subject=place[0],
            take=place[1],
        )
    light = estimate_light(
        list(seen),
        list(seen.values()),
        scene.topology,
        scene.centres(first),
        cfg["detail.relief.detail_mm"],
    )
    settings = ReliefSettings.of(cfg)
    with_standing_relief(light, scene, seen, settings).save(snakemake.output.light)
    uv = scene.topology.finer @ model.uv
    write_obj(snakemake.output.topology, scene.fine(first), scene.topology.triangles, uv)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
