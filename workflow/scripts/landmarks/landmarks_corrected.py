"""Landmarks of a chunk, corrected by flow between key frames, with quality rows and an overlay."""

from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.correction import LandmarkCorrectionSettings, correct_landmarks
from vermilion.landmarks.correction_overlay import correction_overlay
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.gradients import grey_of
from vermilion.landmarks.key_frames import KeyFrames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    camera = snakemake.params.camera
    source = open_frames(snakemake.params.source, subject, take)
    detected = LandmarkTrack.load(list(snakemake.input.landmarks))
    keys = KeyFrames.load(snakemake.input.key_frames)
    track, rows = correct_landmarks(
        lambda frame: grey_of(source.read(camera, frame)),
        detected,
        keys,
        snakemake.params.frames,
        LandmarkCorrectionSettings.of(snakemake.params.cfg["landmarks.correction"]),
    )
    write_srgb8(snakemake.output.overlay, correction_overlay(source, camera, detected, track, keys))
    write_quality(snakemake.output.quality, subject, take, "landmarks", rows)
    track.save(snakemake.output.landmarks)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
