"""The topology of another tracker's mesh sequence, and what was understood of its file."""

from vermilion.external.origin import Origin
from vermilion.external.read import read_tracked
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError


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
    cfg, output = snakemake.params.cfg, snakemake.output
    options = {
        name: cfg[f"tracking.external.{name}"] for name in ("unit_mm", "up", "mesh", "flame")
    }
    found = first_mesh(
        snakemake.input.source,
        snakemake.params.frames,
        **options,
        fps=snakemake.params.fps,
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    print(*found.understood, sep="\n")
    write_ply(output.topology, Mesh(found.vertices_mm[0], found.triangles))
    first = int(found.frames[0])
    Origin(found.unit_mm, found.up, found.turned, found.polygons, first).save(output.sequence)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
