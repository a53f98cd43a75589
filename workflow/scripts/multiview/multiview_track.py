"""The clips of a take joined into its coarse track."""

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.multiview.files import read_anchor, read_clip, read_neutral, write_track
from vermilion.multiview.track import join_clips
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    clips = [read_clip(path) for path in snakemake.input.clips]
    found = join_clips(clips, [read_anchor(path) for path in snakemake.input.anchors])
    print(f"anchor frames: {found.frames[found.anchors].tolist()}")
    print(f"unreadable frames: {np.count_nonzero([reason != '' for reason in found.reasons])}")
    write_track(snakemake.output.track, found)
    model = FaceModel.load(snakemake.input.template)
    neutral = read_neutral(snakemake.input.neutral, model.n_vertices)
    write_ply(snakemake.output.topology, Mesh(neutral, model.triangles))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
