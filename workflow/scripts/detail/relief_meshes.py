"""Meshes with relief, their normals averaged over a window of frames; maps of normals and displacements, residuals."""

import numpy as np

from vermilion.detail.relief.frames import (
    ReliefReader,
    ReliefScene,
    mean_error,
    mesh_with_relief,
    shading_errors,
)
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.normal_map import NormalMap
from vermilion.detail.relief.overlay import relief_panels
from vermilion.faces.model import FaceModel
from vermilion.imaging.draw import sheet
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_channels, write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_folder
from vermilion.storage.frames import evenly_taken
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    model, light = FaceModel.load(inputs.tracker), ClipLight.load(inputs.light)
    first, last = params.span
    own, fit = (params.frames[0], params.frames[-1]), TrackedTake.load(inputs.fit)
    source = open_frames(params.source, *place)
    scene = ReliefScene.open(model, inputs, source, own, cfg)
    topology = scene.topology
    reader = ReliefReader(inputs.reliefs, range(first, last + 1))
    maps = NormalMap(topology, model.uv, cfg["detail.relief.map_px"])
    window, weight = cfg["detail.relief.window"], cfg["detail.relief.position_weight"]
    shown = evenly_taken(params.frames, cfg["detail.relief.overlay_frames"])
    meshes, quality, panels = [], [], []
    heights = snakemake.output.displacements
    with atomic_folder(snakemake.output.maps) as folder, atomic_folder(heights) as raised:
        for frame in progress(list(params.frames), "meshes with relief"):
            smooth = scene.fine(frame)
            span = fit.piece_span(frame)  # normals are not averaged across a cut
            mesh = mesh_with_relief(topology, smooth, reader, frame, span, window, weight)
            drawn = maps.draw(smooth, mesh)
            names = zip("RGB", np.moveaxis(drawn, 2, 0), strict=True)
            write_channels(folder / f"{frame:06d}.exr", dict(names))
            height = maps.draw_displacement(smooth, mesh)
            write_channels(raised / f"{frame:06d}.exr", {"Y": height})
            meshes.append(mesh)
            row, image, errors = residuals(scene, light, reader, frame, smooth, mesh)
            quality.append(row)
            if frame in shown and image is not None:
                panels += relief_panels(
                    f"{frame}", image, scene.camera, topology, smooth, mesh, errors
                )
    write_srgb8(snakemake.output.overlay, sheet(panels, 4))
    write_quality(snakemake.output.quality, *place, "relief", quality)
    for name, path in (("before", snakemake.output.start), ("after", snakemake.output.after)):
        rows = [
            {
                "frame": row.frame,
                "residual": row.figures[f"residual_{name}"],
                "learnt_from": int(row.frame in light.frames),
            }
            for row in quality
        ]
        write_table(path, rows)
    write_sequence(snakemake.output.meshes, np.stack(meshes))


def residuals(scene, light, reader, frame, smooth, mesh):
    """Quality row of a frame, its image (None without), and errors of the skin's triangles."""
    relief = np.linalg.norm(mesh - smooth, axis=1).max()
    figures = {"residual_before": np.nan, "residual_after": np.nan, "relief_mm": relief}
    try:
        image = scene.read_image(frame)
        observed = scene.observe(frame, smooth)
    except (InputError, ValueError):
        return QualityRow(frame, False, reader.reason(frame) or "no image", figures), None, None
    before, after = (
        shading_errors(scene.topology, light, observed, m, scene.camera) for m in (smooth, mesh)
    )
    figures["residual_before"] = mean_error(before, observed.trust)
    figures["residual_after"] = mean_error(after, observed.trust)
    worse = figures["residual_after"] > figures["residual_before"]
    reason = "the relief explains the image worse" if worse else ""
    return QualityRow(frame, True, reason, figures), image, after


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
