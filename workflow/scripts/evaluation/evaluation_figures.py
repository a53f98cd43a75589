"""Renders, surface stretch and error maps from front and side, and curves over time, of a take."""

import numpy as np

from vermilion.config.evaluation import FiguresConfig
from vermilion.config.regressors import in_order
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.provenance.begun_run import begin_job
from vermilion.report import mesh_sheets
from vermilion.report.figures import plot_curves
from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_table

LIPS_MM = 110.0


def images(snakemake, shown, size_px):
    """The mouth in the take's own images at the scale of the renders."""
    source = open_frames(
        snakemake.params.source, snakemake.wildcards.subject, snakemake.wildcards.take
    )
    found = []
    for frame, centre, scale in zip(
        shown["frames"], shown["centre_px"], shown["px_per_mm"], strict=True
    ):
        try:
            image = to_display(source.read(snakemake.params.camera, int(frame)))
        except InputError:
            image = np.full((8, 8, 3), 255, np.uint8)
        found.append(mesh_sheets.crop(image, centre, LIPS_MM * scale, size_px))
    return found


def of_regressors(shown, name):
    """Regressor -> its part of an array, in the order of table 1."""
    names = shown["regressors"].tolist()
    return {key: shown[name][names.index(key)] for key in in_order(names)}


def with_bar(image, bar):
    return np.vstack([image, bar])


def main(snakemake):
    cfg = FiguresConfig(**snakemake.params.cfg["evaluation.figures"])
    shown = read_arrays(snakemake.input.maps, "file of the evaluation")
    out, size = snakemake.output, cfg.map_size_px
    frames, triangles = shown["frames"], shown["triangles"]
    meshes = of_regressors(shown, "meshes_mm")
    base = meshes["base"]

    mouth = base[:, shown["mouth"]]
    wide = 1.35 * np.ptp(mouth, axis=1)[:, :2].max()
    columns = mesh_sheets.error_columns(
        meshes, of_regressors(shown, "errors_mm"), triangles, cfg.error_scale_mm
    )
    image = mesh_sheets.render_sheet(columns, frames, np.nanmean(mouth, axis=1), wide, size)
    bar = mesh_sheets.error_bar(image.shape[1], cfg.error_scale_mm)
    write_srgb8(out.maps, with_bar(image, bar))

    lips = base[:, shown["vermilion"]].mean(axis=1)
    place = (frames, lips, LIPS_MM, size)
    surface = shown["surface_mm"]
    columns = mesh_sheets.clay_columns(meshes, triangles, shown["vermilion"])
    red = mesh_sheets.labels_nearby(shown["vermilion"], shown["points_mm"][0], surface[0])
    columns += mesh_sheets.clay_columns({"truth": surface}, shown["surface_triangles"], red)
    write_srgb8(
        out.renders, mesh_sheets.render_sheet(columns, *place, images(snakemake, shown, size))
    )

    columns = mesh_sheets.stretch_columns(
        meshes | {"truth": shown["points_mm"]},
        of_regressors(shown, "neutrals_mm") | {"truth": shown["rest_mm"]},
        triangles,
    )
    image = mesh_sheets.render_sheet(columns, *place)
    write_srgb8(out.stretch, with_bar(image, mesh_sheets.stretch_bar(image.shape[1])))

    title = f"{snakemake.wildcards.subject}/{snakemake.wildcards.take}"
    plot_curves(read_table(snakemake.input.frames), title, out.curves)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
