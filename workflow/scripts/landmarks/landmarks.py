"""Landmarks of a chunk of the monocular images, with quality rows and an overlay."""

from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.choose import open_detector
from vermilion.landmarks.detect import detect_frames, landmark_overlay
from vermilion.landmarks.sets import IBUG66
from vermilion.landmarks.table import read_landmark_csv
from vermilion.storage.logfile import log_to
from vermilion.storage.quality import write_quality


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    cfg, camera = snakemake.params.cfg, snakemake.params.camera
    source = open_frames(snakemake.params.source, subject, take)
    if cfg["landmarks.detector"] == "csv":
        options = {**cfg["landmarks.csv"], "path": snakemake.input.csv}
        find, landmark_set = read_landmark_csv(**options).at, IBUG66
    else:
        detector = open_detector(
            cfg["landmarks.detector"], snakemake.params.model, cfg["landmarks.networks"]
        )
        landmark_set = detector.landmark_set

        def find(frame):
            return detector.detect(source.read(camera, frame))

    track, rows = detect_frames(find, snakemake.params.frames, landmark_set)
    write_srgb8(snakemake.output.overlay, landmark_overlay(source, camera, track))
    write_quality(snakemake.output.quality, subject, take, "landmarks", rows)
    track.save(snakemake.output.landmarks)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
