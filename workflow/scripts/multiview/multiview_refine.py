"""The frames of a chunk registered to the neutral: meshes, visibility, quality, overlay."""

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import unique_edges
from vermilion.imaging.images import write_srgb8
from vermilion.multiview.files import read_neutral, read_track
from vermilion.multiview.overlay import frames_sheet
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import MultiviewImages, Refiner, RefineSettings
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.arrays import write_array
from vermilion.storage.frames import evenly_taken
from vermilion.storage.progress import progress
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import write_sequence


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, inputs, frames = snakemake.params.cfg, snakemake.input, snakemake.params.frames
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    stereo = StereoSettings(**cfg["multiview.stereo"])
    settings = RefineSettings(**cfg["multiview.refine"])
    model = FaceModel.load(inputs.template)
    images = MultiviewImages.open(
        snakemake.params.source, inputs.cameras, cfg["multiview.images"], subject, take
    )
    neutral = read_neutral(inputs.neutral, model.n_vertices)
    coarse = read_track(inputs.track, frames)
    refiner = Refiner(
        images, model, snakemake.params.neutral, neutral, stereo, settings, FlowMatcher()
    )
    drawn = evenly_taken(frames, 3)
    meshes, seeing, rows, shown = [], [], [], []
    for number, start in progress(zip(frames, coarse, strict=True), "multiview", len(frames)):
        found = refiner.refine(number, start)
        meshes.append(found.registered.vertices_mm.astype(np.float32))
        seeing.append(found.registered.cameras_seeing)
        rows.append(found.quality)
        if number in drawn and found.quality.valid:
            shown.append((images.load(number), found))
    write_sequence(snakemake.output.meshes, np.array(meshes))
    write_array(snakemake.output.visibility, np.array(seeing))
    write_quality(snakemake.output.quality, subject, take, "multiview", rows)
    write_srgb8(
        snakemake.output.overlay,
        frames_sheet(shown, model.triangles, unique_edges(model.triangles)),
    )


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
