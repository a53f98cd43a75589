"""One frame moved onto its sketches, or taken from its sculpt, with its quality row and overlay."""

from pathlib import Path

import numpy as np

from vermilion.config.guided import RegionsConfig, SketchRefinementConfig
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.guided.inputs import read_sculpt, read_sketch_views, sketch_cameras
from vermilion.guided.overlay import draw_refinement
from vermilion.guided.refined_frame import RefinedFrame
from vermilion.guided.refinement import RefinementSettings, SketchRefiner
from vermilion.guided.regions import regions_of_face
from vermilion.guided.silhouette import ContourSurface
from vermilion.imaging.draw import tile, to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.chunks import read_frames
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.tracking.result import TrackedTake

#: A contour that stays further off its stroke is reported.
OFF_PX = 1.0


def cameras_of(snakemake):
    """The take's cameras; the tracked one as the tracker used it, where the sequence is its own."""
    tracked = TrackedTake.load(snakemake.input.fit).camera
    cameras = read_cameras(snakemake.input.cameras)
    return sketch_cameras(cameras, tracked, snakemake.params.tracked), tracked


def sculpt_of(inputs, face, path):
    """The sculpted mesh (V, 3) mm in the world of the sequence.

    That of another tracker's sequence is in its own unit, axes and world, as it was exported.
    """
    if not inputs.get("placement"):
        return read_sculpt(path, face.triangles, face.n_vertices)
    origin, placement = Origin.load(inputs.origin), Placement.load(inputs.placement)
    found = read_sculpt(path, face.triangles, face.n_vertices, origin.unit_mm)
    return placement.apply(origin.upright(found))


def quality_row(frame, refined):
    """How far the contours of a refined frame are from its strokes."""
    off = np.concatenate([d for curves in refined.distance_px.values() for d in curves.values()])
    figures = {
        "stroke_mean_px": off.mean(), "stroke_largest_px": off.max(), "depth_mm": refined.depth_mm,
    }  # fmt: skip
    far = f"a contour stays {off.max():.1f} px off its stroke" if off.max() > OFF_PX else ""
    return QualityRow(frame, True, far, figures)


def overlay(snakemake, views, camera, surface, base, corrected):
    """Each sketched image, or that of the tracked camera, with the contours over it."""
    source = open_frames(
        snakemake.params.source, snakemake.wildcards.subject, snakemake.wildcards.take
    )
    shown = []
    for sketch, seen_by in views or [(None, camera)]:
        try:
            image = to_display(source.read(seen_by.name, int(snakemake.wildcards.frame)))
        except InputError as error:
            print(error)
            image = np.zeros((seen_by.height_px, seen_by.width_px, 3), np.uint8)
        shown.append(draw_refinement(image, seen_by, surface, base, corrected, sketch))
    return tile(shown, columns=3)


def main(snakemake):
    cfg, frame = snakemake.params.cfg, int(snakemake.wildcards.frame)
    face = FaceModel.load(snakemake.input.face)
    regions = regions_of_face(face, **RegionsConfig(**cfg["guided.regions"]).model_dump())
    surface = ContourSurface.of_face(face, regions)
    cameras, tracked = cameras_of(snakemake)
    base = read_frames([snakemake.input.sequence], [frame])[0].astype(np.float64)
    files = [Path(path) for path in snakemake.input.corrections]
    if snakemake.params.kind == "sculpt":
        corrected, views = sculpt_of(snakemake.input, face, files[0]), []
        row = QualityRow(frame)
    else:
        settings = SketchRefinementConfig(**cfg["guided.refinement"]).model_dump()
        crossings = LipCrossings(face) if cfg["guided.contact"] else None
        refiner = SketchRefiner(
            regions, surface, crossings=crossings, settings=RefinementSettings(**settings)
        )
        views = read_sketch_views(files, cameras, frame)
        refined = refiner.refine(base, views)
        corrected, row = refined.vertices_mm, quality_row(frame, refined)
    print(f"frame {frame}: {snakemake.params.kind} {row.figures or ''}")
    RefinedFrame(frame, snakemake.params.kind, corrected, base).save(snakemake.output.refined)
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    write_quality(snakemake.output.quality, *place, "guided_refine", [row])
    image = overlay(snakemake, views, tracked, surface, base, corrected)
    write_srgb8(snakemake.output.overlay, image)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
