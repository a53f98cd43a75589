"""The topology of the coarse sequence: the person's neutral in the head frame."""

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.provenance.begun_run import begin_job
from vermilion.tracking.result import Identity


def main(snakemake):
    tracker = FaceModel.load(snakemake.input.tracker)
    neutral = Identity.load(snakemake.input.identity).neutral_mm
    write_ply(snakemake.output[0], Mesh(neutral, tracker.triangles))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
