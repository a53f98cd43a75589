"""Features of every frame of a chunk: shape coefficients and contour distances (Lips16 5.1)."""

from dataclasses import replace
from pathlib import Path

from vermilion.config.features import ContourFeaturesConfig, ShapeFeaturesConfig
from vermilion.contours.landmark_rings import LandmarkRings, dense_lips
from vermilion.contours.maps import read_maps
from vermilion.faces.model import FaceModel
from vermilion.features.contour_features import ContourSampler
from vermilion.features.contradiction import contradiction
from vermilion.features.overlay import contours_overlay
from vermilion.features.search import SearchSettings
from vermilion.features.shape_space import shape_space
from vermilion.features.tracked_lips import TrackedLips
from vermilion.features.vector import FeatureTable, quality_row
from vermilion.geometry.head_frame import head_from_world
from vermilion.imaging.draw import sheet
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_taken
from vermilion.storage.progress import progress
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import Identity, TrackedTake


def landmark_rings(path):
    """The lips' rings in the frames of a chunk; None where the landmarks are too few to judge contours."""
    track = LandmarkTrack.load(path, None)
    return LandmarkRings(track) if dense_lips(track) else None


def main(snakemake) -> None:
    shape_cfg = ShapeFeaturesConfig(**snakemake.params.cfg["features.shape"])
    cfg = ContourFeaturesConfig(**snakemake.params.cfg["features.contours"])
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    model = FaceModel.load(snakemake.input.model)
    fit = TrackedTake.load(snakemake.input.fit)
    rows = fit.index_of(snakemake.params.frames)
    coarse = read_sequence(snakemake.input.coarse)
    poses = fit.world_from_head_rotation[rows], fit.world_from_head_translation_mm[rows]
    neutral_mm = Identity.load(snakemake.input.identity).neutral_mm
    displacement = head_from_world(coarse, *poses) - neutral_mm
    space = shape_space(model, shape_cfg.variance)
    print(f"{space.size} shape coefficients hold {space.kept:.2%} of the variance")
    sampler = ContourSampler.of(model, cfg.samples, SearchSettings.of(cfg))
    source = open_frames(snakemake.params.source, subject, take)
    shown = evenly_taken(snakemake.params.frames, cfg.overlay_frames)
    rings, lips = landmark_rings(snakemake.input.landmarks), TrackedLips.of(model)
    contours, quality, images = [], [], []
    for index, frame in enumerate(progress(list(snakemake.params.frames), "features")):
        path = Path(snakemake.input.maps) / f"{frame:06d}.exr"
        maps = read_maps(path, frame=frame) if path.exists() else None
        pose = (poses[0][index], poses[1][index]) if cfg.space == "head" else None
        seen = None if rings is None else rings(frame)
        found = sampler.find(coarse[index], fit.camera, maps, pose, seen)
        tracked = bool(fit.valid[rows[index]])
        contours.append(found)
        row = quality_row(frame, found, tracked, maps is not None, cfg.least_found)
        if row.valid and rings is not None:
            known = [
                (seen or (None, None))[1],
                lips.rings_px(coarse[index], fit.camera)[1],
            ]
            reason = contradiction(found.inner_px, known, found.interocular_px, cfg.most_apart)
            row = replace(row, valid=not reason, reason=reason)
        quality.append(row)
        if frame in shown:
            try:
                image = source.read(snakemake.params.camera, frame)
            except InputError:
                continue
            images.append(contours_overlay(image, found, frame))
    table = FeatureTable.of(
        snakemake.params.frames,
        space.coefficients(displacement),
        contours,
        [entry.valid for entry in quality],
        cfg.space,
    )
    table.save(snakemake.output.features)
    write_quality(snakemake.output.quality, subject, take, "features", quality)
    write_srgb8(snakemake.output.overlay, sheet(images, columns=5))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
