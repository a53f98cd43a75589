"""Read, calibrate or assume the cameras of a take; write them as COLMAP text with an overlay."""

import json
from dataclasses import fields

import numpy as np

from vermilion.capture.board import Board
from vermilion.capture.calibrate import CalibrationSettings
from vermilion.capture.manifest import load_manifest
from vermilion.capture.overlay import (
    calibration_sheet,
    contact_sheet,
    refinement_sheet,
    worst_view,
)
from vermilion.capture.refine import refine_cameras
from vermilion.capture.rig import calibration_views, image_sizes, rig_cameras
from vermilion.capture.rig_poses import RigRefinementSettings
from vermilion.capture.tracks import FeatureMatchSettings, find_features
from vermilion.config.capture import CalibrationConfig, RigRefinementConfig
from vermilion.geometry.camera import write_cameras
from vermilion.imaging.frames import open_frames, read_or_none
from vermilion.imaging.images import read_image, write_srgb8
from vermilion.imaging.source import folder_of
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.files import write_text
from vermilion.storage.progress import progress


def wanted(cfg, rig):
    """Whether a refinement is to be tried."""
    methods = ("given", "charuco", "checkerboard") if cfg.board_calibrated else ("given",)
    return cfg.mode != "off" and len(rig.cameras) > 1 and rig.method in methods


def settings_from(kind, cfg):
    """Settings of a class from the keys of a section that have the same names."""
    return kind(**{f.name: getattr(cfg, f.name) for f in fields(kind)})


def features_of(source, rig, frames, cfg):
    """Frame -> camera -> features; images that cannot be read are left out."""
    found = {}
    for frame in progress(frames, "features"):
        found[frame] = {}
        for name in rig.cameras:
            try:
                image = source.read(name, frame)
            except InputError as error:
                print(error)
                continue
            found[frame][name] = find_features(image, cfg.contrast, cfg.max_features)
    return found


def refinement(cfg, rig, manifest, first, last):
    """The rig refined over some frames, or as it was with the reason."""
    frames = sorted({int(f) for f in np.linspace(first, last, cfg.frames).round()})
    source = open_frames(manifest.source, manifest.subject, manifest.take)
    matching, settings = (
        settings_from(kind, cfg) for kind in (FeatureMatchSettings, RigRefinementSettings)
    )
    images = features_of(source, rig, frames, cfg)
    made = refine_cameras(rig.cameras, images, matching, settings, cfg.mode == "auto")
    print(
        f"refinement of the cameras {'applied' if made.applied else 'not applied'}: {made.reason}"
    )
    if cfg.mode == "on" and not made.applied:
        raise InputError(
            f"cameras that could not be refined ({made.reason})",
            "features that many cameras share",
            "Use more frames (`capture.refinement.frames`), check that the images are sharp and "
            "the poses within `capture.refinement.gate_deg`, or set `capture.refinement.mode: auto`.",
            subject=manifest.subject,
            take=manifest.take,
        )
    return made


def overlay(rig, manifest, neutral, made):
    """The refinement's points, the worst board view of each camera, or the neutral's images."""
    if rig.calibration is not None:
        folder = folder_of(manifest.source, "calibration")
        moments = {name: worst_view(rig.calibration, name) for name in rig.cameras}
        views = {
            name: {moment: read_image(calibration_views(folder, name)[moment])}
            for name, moment in moments.items()
        }
        return calibration_sheet(rig.calibration, views)
    source = open_frames(manifest.source, manifest.subject, manifest.take)
    images = {name: read_or_none(source, name, neutral) for name in rig.cameras}
    if made is not None and made.shown and any(p is not None for p in images.values()):
        return refinement_sheet(images, made.shown, made.moved)
    return contact_sheet(images)


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
        settings_from(CalibrationSettings, cfg),
        focal=snakemake.params.focal,
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    refine = RigRefinementConfig(**snakemake.params.cfg["capture.refinement"])
    summary, made = rig.summary(), None
    first, last = snakemake.params.frames
    if wanted(refine, rig):
        made = refinement(refine, rig, manifests[0], first, last)
        summary["refinement"] = {"mode": refine.mode, **made.summary()}
    write_srgb8(snakemake.output.overlay, overlay(rig, manifests[0], first, made))
    write_text(snakemake.output.summary, json.dumps(summary, indent=1, sort_keys=True) + "\n")
    write_cameras(snakemake.output.cameras, made.cameras if made else rig.cameras)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
