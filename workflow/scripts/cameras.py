"""Read, calibrate or assume the cameras of a take; write them as COLMAP text with an overlay."""

import json
from pathlib import Path

from vermilion.camera import write_cameras
from vermilion.capture.board import Board
from vermilion.capture.manifest import load_manifest
from vermilion.capture.overlay import calibration_sheet, contact_sheet, worst_view
from vermilion.capture.rig import calibration_views, image_sizes, rig_cameras
from vermilion.config.capture import CalibrationConfig
from vermilion.errors import InputError
from vermilion.files import atomic_path
from vermilion.frames import open_frames
from vermilion.images import read_image, write_srgb8
from vermilion.logfile import log_to


def overlay(rig, manifest, neutral):
    """The worst board view of each camera, or the neutral in every camera."""
    if rig.calibration is not None:
        folder = Path(manifest.source) / "calibration"
        moments = {name: worst_view(rig.calibration, name) for name in rig.cameras}
        views = {
            name: {moment: read_image(calibration_views(folder, name)[moment])}
            for name, moment in moments.items()
        }
        return calibration_sheet(rig.calibration, views)
    source, pictures = open_frames(manifest.source, manifest.subject, manifest.take), {}
    for name in rig.cameras:
        try:
            pictures[name] = source.read(name, neutral)
        except InputError:
            pictures[name] = None
    return contact_sheet(pictures)


def main(snakemake):
    cfg = CalibrationConfig(**snakemake.params.cfg["capture.calibration"])
    manifests = [load_manifest(path) for path in snakemake.input.manifests]
    board = Board(
        cfg.board, cfg.squares, cfg.square_mm, cfg.marker_mm, cfg.dictionary, cfg.legacy_pattern
    )
    rig = rig_cameras(
        manifests[0].source,
        image_sizes(manifests),
        snakemake.params.camera,
        board,
        cfg.camera_model,
        cfg.refine_principal_point,
        cfg.max_view_px,
        cfg.assumed_focal,
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    write_srgb8(snakemake.output.overlay, overlay(rig, manifests[0], snakemake.params.neutral))
    with atomic_path(snakemake.output.summary) as temporary:
        temporary.write_text(json.dumps(rig.summary(), indent=1, sort_keys=True) + "\n")
    write_cameras(snakemake.output.cameras, rig.cameras)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
