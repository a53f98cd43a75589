"""Check the images of a chunk; write its manifest, quality rows and a contact sheet."""

from vermilion.capture.manifest import capture_manifest, quality_rows
from vermilion.capture.overlay import contact_sheet
from vermilion.capture.video_facts import load_video_facts
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.storage.errors import InputError
from vermilion.storage.logfile import log_to
from vermilion.storage.quality import write_quality


def first_images(manifest, frame):
    """Camera -> linear image of a frame, None where it cannot be read."""
    source = open_frames(manifest.source, manifest.subject, manifest.take)
    images = {}
    for camera in manifest.cameras:
        try:
            images[camera] = source.read(camera, frame)
        except InputError:
            images[camera] = None
    return images


def main(snakemake):
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    frames = snakemake.params.frames
    camera = snakemake.params.camera
    video = snakemake.input.get("video")
    manifest = capture_manifest(
        snakemake.params.source,
        subject,
        take,
        frames,
        None if snakemake.params.multiview else [camera],
        hash_decoded=snakemake.params.cfg["capture.manifest"]["hash_decoded"],
        video=load_video_facts(video) if video else None,
        fps=snakemake.params.fps,
    )
    for warning in manifest.warnings:
        print(f"warning: {warning}")
    write_quality(
        snakemake.output.quality, subject, take, "capture", quality_rows(manifest, frames, [camera])
    )
    write_srgb8(snakemake.output.overlay, contact_sheet(first_images(manifest, frames[0])))
    manifest.save(snakemake.output.manifest)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
