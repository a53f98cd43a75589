"""The template registered to the first frame of a take: neutral, point cloud, overlay."""

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import unique_edges
from vermilion.geometry.mesh_files import write_ply
from vermilion.imaging.images import write_srgb8
from vermilion.multiview.cloud import write_cloud
from vermilion.multiview.files import read_landmark_views, read_neutral, write_neutral
from vermilion.multiview.neutral import NeutralSettings, register_neutral
from vermilion.multiview.overlay import neutral_sheet
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.register_to_first_take import register_to_first_take
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import MultiviewImages, Refiner, RefineSettings
from vermilion.multiview.triangulate import triangulate_landmarks
from vermilion.provenance.begun_run import begin_job


def refiner_of_first_take(snakemake, stereo, model):
    """What registers images to the neutral of the person's first take."""
    first, inputs = snakemake.params.first, snakemake.input
    options, place = snakemake.params.cfg["multiview.images"], snakemake.wildcards.subject
    images = MultiviewImages.open(
        first["source"], inputs.first_cameras, options, place, first["take"]
    )
    neutral = read_neutral(inputs.first_neutral, model.n_vertices)
    settings = RefineSettings(**first["cfg"]["multiview.refine"])
    return Refiner(images, model, first["frame"], neutral, stereo, settings, FlowMatcher())


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, inputs = snakemake.params.cfg, snakemake.input
    stereo = StereoSettings(**cfg["multiview.stereo"])
    neutral = {k: v for k, v in cfg["multiview.neutral"].items() if k != "same_points"}
    limits = {name: neutral.pop(name) for name in ("min_confidence", "landmark_distance_mm")}
    model = FaceModel.load(inputs.template)
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    images = MultiviewImages.open(
        snakemake.params.source, inputs.cameras, cfg["multiview.images"], subject, take
    )
    frame = images.load(snakemake.params.frame)
    names, points, confidence = read_landmark_views(inputs.landmarks, frame.views)
    landmarks = triangulate_landmarks(
        images.cameras,
        names,
        points,
        confidence,
        min_confidence=limits["min_confidence"],
        max_distance_mm=limits["landmark_distance_mm"],
    )
    found = register_neutral(
        frame, model, landmarks, stereo, NeutralSettings(**neutral), FlowMatcher()
    )
    print(f"{int(landmarks.valid.sum())} landmarks, {len(found.cloud)} points")
    if snakemake.params.first:
        first = refiner_of_first_take(snakemake, stereo, model)
        name = snakemake.params.first["take"]
        found, why = register_to_first_take(first, name, frame, found)
        if why:
            print(
                f"WARNING: {subject}/{take}: found {why} between its neutral and that of {name}; "
                f"expected images that match. Its own fit is kept, whose vertices may lie elsewhere "
                f"on the skin than those of {name}. Look at both neutrals' overlays."
            )
        else:
            moved = np.percentile(found.moved_mm, (50, 95))
            print(
                f"moved to the points of {name}: {moved[0]:.2f} mm median, {moved[1]:.2f} mm 95 %"
            )
    print(f"seen by a pair: {np.mean(found.information > 0):.0%} of the vertices")
    write_neutral(snakemake.output.neutral, found)
    write_cloud(snakemake.output.cloud, found.cloud)
    write_ply(snakemake.output.surface, found.surface)
    sheet = neutral_sheet(frame, found, model.triangles, unique_edges(model.triangles))
    write_srgb8(snakemake.output.overlay, sheet)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
