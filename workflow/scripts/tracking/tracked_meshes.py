"""A chunk of another tracker's mesh sequence."""

from vermilion.storage.logfile import log_to
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.external.read import read_tracked


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
    for frame, reason in sorted(sequence.lost.items()):
        print(f"frame {frame}: {reason}")
    write_sequence(snakemake.output.meshes, sequence.vertices_mm)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
