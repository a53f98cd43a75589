"""The report page of a take: report.html; and the drift of all its frames: drift.tsv."""

import cv2
import pandas as pd

from vermilion.faces.model import FaceModel
from vermilion.multiview.drift import DriftSettings
from vermilion.multiview.files import read_anchors, read_neutral
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import MultiviewImages, RefineSettings
from vermilion.provenance.begun_run import begin_job
from vermilion.report.multiview_page import TakeFindings, choose_frames, join_frames, report_page
from vermilion.report.multiview_sheets import SheetSettings
from vermilion.report.multiview_take_sheets import TakeSheets
from vermilion.storage.arrays import read_array
from vermilion.storage.files import write_text
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence, rows_of_frames
from vermilion.storage.tables import read_table, write_table


def joined(paths):
    """Tables of the chunks as one; empty without chunks."""
    return pd.concat([read_table(path) for path in paths] or [pd.DataFrame()], ignore_index=True)


def rows_at(paths, frames, read):
    """Frame number -> its row of the chunk files, where there is one."""
    return {frame: read(path)[row] for frame, (path, row) in rows_of_frames(paths, frames).items()}


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, inputs = snakemake.params.cfg, snakemake.input
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    report, drift_settings = cfg["multiview.report"], DriftSettings(**cfg["multiview.drift"])
    model = FaceModel.load(inputs.template)
    images = MultiviewImages.open(
        snakemake.params.source, inputs.cameras, cfg["multiview.images"], **place
    )
    sheets = TakeSheets(
        images,
        model,
        snakemake.params.neutral,
        read_neutral(inputs.neutral, model.n_vertices, **place),
        StereoSettings(**cfg["multiview.stereo"]),
        RefineSettings(**cfg["multiview.refine"]),
        drift_settings,
        SheetSettings(
            report["image_px"], report["residual_px"], report["cloud_mm"], drift_settings.scale
        ),
        FlowMatcher(),
    )
    drift, frames = joined(inputs.drift), pd.DataFrame()
    if len(drift):
        _, similarity, anchors = read_anchors(inputs.track[0])
        frames = join_frames(joined(inputs.quality), drift, similarity, anchors)
    why = choose_frames(
        frames, snakemake.params.neutral, report["spaced_frames"], report["flagged_frames"]
    )
    meshes = rows_at(inputs.meshes, why, read_sequence)
    seeing = rows_at(inputs.visibility, why, lambda path: read_array(path, "visibility"))
    shown = [
        sheets.draw(number, reason, meshes.get(number), seeing.get(number))
        for number, reason in progress(list(why.items()), "sheets")
    ]
    found = TakeFindings(
        "/".join(place.values()),
        snakemake.params.neutral,
        sorted(images.cameras),
        frames,
        drift,
        sheets.across_rows(),
    )
    columns = ["subject", "take", *found.across.columns]
    write_table(snakemake.output.drift, drift if len(drift) else pd.DataFrame(columns=columns))
    write_text(snakemake.output.page, report_page(found, shown, report["page_mb"]))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
