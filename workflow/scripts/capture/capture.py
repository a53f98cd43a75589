"""Check the images of a chunk; write its manifest, quality rows and a contact sheet."""

from vermilion.capture.manifest import capture_manifest, quality_rows
from vermilion.capture.overlay import contact_sheet
from vermilion.capture.video_facts import load_video_facts
from vermilion.imaging.frames import open_frames, read_or_none
from vermilion.imaging.images import write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality


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
    source = open_frames(manifest.source, subject, take)
    images = {name: read_or_none(source, name, frames[0]) for name in manifest.cameras}
    write_srgb8(snakemake.output.overlay, contact_sheet(images))
    manifest.save(snakemake.output.manifest)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
