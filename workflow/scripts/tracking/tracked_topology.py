"""The topology of another tracker's mesh sequence."""

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.storage.errors import InputError
from vermilion.storage.logfile import log_to
from vermilion.tracking.external.read import read_tracked


def first_mesh(source, frames, **options):
    """The first of the frames that can be read."""
    for frame in frames:
        try:
            return read_tracked(source, [frame], **options)
        except InputError as error:
            print(error)
            problem = error
    raise problem


def main(snakemake):
    sequence = first_mesh(
        snakemake.input.source,
        snakemake.params.frames,
        **snakemake.params.cfg["tracking.external"],
        fps=snakemake.params.fps,
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    write_ply(snakemake.output[0], Mesh(sequence.vertices_mm[0], sequence.triangles))


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
