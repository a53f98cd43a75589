"""A chunk of another tracker's mesh sequence."""

from vermilion.storage.logfile import log_to
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.external import read_tracked


def main(snakemake):
    sequence = read_tracked(
        snakemake.input.source,
        snakemake.params.frames,
        snakemake.params.cfg["tracking.external"]["unit_mm"],
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    write_sequence(snakemake.output.meshes, sequence.vertices_mm)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
