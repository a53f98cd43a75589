"""The topology of another tracker's mesh sequence."""

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.storage.logfile import log_to
from vermilion.tracking.external.read import read_tracked


def main(snakemake):
    sequence = read_tracked(
        snakemake.input.source,
        [snakemake.params.first],
        **snakemake.params.cfg["tracking.external"],
        fps=snakemake.params.fps,
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    write_ply(snakemake.output[0], Mesh(sequence.vertices_mm[0], sequence.triangles))


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
