"""Landmarks of the followed face in a chunk of the monocular images, with quality rows and an overlay."""

from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detect import followed_track, landmark_overlay
from vermilion.landmarks.faces import FaceFinds
from vermilion.landmarks.following import FollowedFace
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    finds = FaceFinds.load(snakemake.input.faces)
    track, rows = followed_track(finds, FollowedFace.load(snakemake.input.followed))
    source = open_frames(snakemake.params.source, subject, take)
    overlay = landmark_overlay(source, snakemake.params.camera, track)
    write_srgb8(snakemake.output.overlay, overlay)
    write_quality(snakemake.output.quality, subject, take, "landmarks", rows)
    track.save(snakemake.output.landmarks)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
