"""A chunk of another tracker's mesh sequence."""

from vermilion.storage.logfile import log_to
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.external.read import read_tracked


def lost_reason(found):
    """What a user reads of a lost frame; empty for one that is there."""
    return f"no mesh: {found}; export this frame again" if found else ""


def main(snakemake):
    params = snakemake.params
    sequence = read_tracked(
        snakemake.input.source,
        params.frames,
        **params.cfg["tracking.external"],
        fps=params.fps,
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    print(*sequence.understood, sep="\n")
    write_sequence(snakemake.output.meshes, sequence.vertices_mm)
    rows = [
        QualityRow(int(frame), frame not in sequence.lost, lost_reason(sequence.lost.get(frame)))
        for frame in params.frames
    ]
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    write_quality(snakemake.output.quality, *place, "tracking", rows)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
