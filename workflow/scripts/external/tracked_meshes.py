"""A chunk of another tracker's mesh sequence."""

from vermilion.external.origin import Origin
from vermilion.external.read import read_tracked
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence


def lost_reason(found):
    """What a user reads of a lost frame; empty for one that is there."""
    return f"no mesh: {found}; export this frame again" if found else ""


def main(snakemake):
    params, place = snakemake.params, dict(snakemake.wildcards)
    place = {name: place[name] for name in ("subject", "take")}
    origin, asked = Origin.load(snakemake.input.sequence), list(params.frames)
    # With a frame that the file has: a chunk without any is lost, not refused, and its topology compared.
    known = [] if origin.first in asked else [origin.first]
    sequence = read_tracked(
        snakemake.input.source,
        asked + known,
        origin.unit_mm,
        up=params.cfg["tracking.external.up"],
        mesh=params.cfg["tracking.external.mesh"],
        flame=params.cfg["tracking.external.flame"],
        fps=params.fps,
        **place,
    )
    print(*sequence.understood, sep="\n")
    write_sequence(snakemake.output.meshes, sequence.vertices_mm[: len(asked)])
    rows = [
        QualityRow(int(frame), frame not in sequence.lost, lost_reason(sequence.lost.get(frame)))
        for frame in asked
    ]
    write_quality(snakemake.output.quality, *place.values(), "tracking", rows)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
