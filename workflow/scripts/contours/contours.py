"""Likelihood maps of the inner and outer lip contour of a chunk (Lips16 3.2.2)."""

from vermilion.config.contours import ContourMapsConfig
from vermilion.contours.detector_file import load_detector
from vermilion.contours.labels import label_paths, read_contour_label
from vermilion.contours.landmark_rings import LandmarkRings, dense_lips
from vermilion.contours.maps import frame_maps, maps_overlay, write_maps
from vermilion.faces.model import FaceModel
from vermilion.features.tracked_lips import TrackedLips
from vermilion.imaging.draw import sheet
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.files import atomic_folder
from vermilion.storage.frames import evenly_taken
from vermilion.storage.progress import progress
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import TrackedTake


def main(snakemake) -> None:
    cfg = ContourMapsConfig(**snakemake.params.cfg["contours.maps"])
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    source = open_frames(snakemake.params.source, subject, take)
    detector = load_detector(snakemake.input.detector)
    found = LandmarkTrack.load(snakemake.input.landmarks, None)
    track = found.as_ibug66()
    labels = label_paths(snakemake.params.capture, snakemake.params.camera)
    frames, lips_px = track.frames.tolist(), {}
    if dense_lips(found):
        rings = LandmarkRings(found)
        lips_px = {frame: rings(frame) for frame in frames}
    elif detector.from_track:
        coarse = read_sequence(snakemake.input.coarse[0])
        lips = TrackedLips.of(FaceModel.load(snakemake.input.tracker))
        camera = TrackedTake.load(snakemake.input.fit).camera
        lips_px = {f: lips.rings_px(coarse[row], camera) for row, f in enumerate(frames)}
    shown = evenly_taken(frames, cfg.overlay_frames)
    rows, images = [], []
    with atomic_folder(snakemake.output.maps) as folder:
        for index, frame in enumerate(progress(frames, "contour maps")):
            points = track.points_px[index]
            maps, image, row = frame_maps(
                source,
                snakemake.params.camera,
                frame,
                points,
                bool(track.valid[index]),
                detector,
                cfg.least_peak,
                lips_px.get(frame),
            )
            rows.append(row)
            if maps is None:
                continue
            write_maps(folder / f"{frame:06d}.exr", *maps)
            if frame in shown or frame in labels:
                drawn = read_contour_label(labels[frame]) if frame in labels else None
                images.append(maps_overlay(image, maps, points, frame, drawn))
    write_quality(snakemake.output.quality, subject, take, "contours", rows)
    write_srgb8(snakemake.output.overlay, sheet(images))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
