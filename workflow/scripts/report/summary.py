"""Every result on one HTML page that opens offline."""

import os
from pathlib import Path

import pandas as pd

from vermilion.provenance.begun_run import begin_job
from vermilion.report.summary import (
    FRAME_COLUMNS,
    REGRESSOR_COLUMNS,
    Overlay,
    SummaryInputs,
    summary_page,
)
from vermilion.storage.files import atomic_path
from vermilion.storage.tables import read_table


def settings(cfg):
    """The configuration that the figures depend on, as (dotted key, value) pairs."""
    rows = []
    for key, value in cfg.items():
        if isinstance(value, dict):
            rows += settings({f"{key}.{name}": item for name, item in value.items()})
        else:
            rows.append((key, str(value)))
    return rows


def main(snakemake):
    inputs, names, cfg = snakemake.input, snakemake.params.names, dict(snakemake.params.cfg)
    limit_mb = cfg.pop("evaluation.figures.embed_video_mb")

    def named(kind, paths):
        return [(name, Path(path)) for name, path in zip(names[kind], paths, strict=True)]

    tables = (
        "measures",
        "headline",
        "table1",
        "kinds",
        "comparisons",
        "table2",
        "table3",
        "estimators",
    )
    found = SummaryInputs(
        **{name: read_table(inputs[name]) for name in tables},
        flagged=read_table(inputs.quality),
        configured=cfg["training"]["regressor"],
        applied=snakemake.params.applied,
        table1_image=Path(inputs.image),
        figure16=Path(inputs.figure16),
        renders=named("maps", inputs.renders),
        stretch=named("maps", inputs.stretch),
        reconstructions=[
            (name, os.path.relpath(path, Path(snakemake.output.page).parent))
            for name, path in zip(names["reconstructions"], inputs.reconstructions, strict=True)
        ],
        error_maps=named("maps", inputs.maps),
        over_time=named("maps", inputs.curves),
        curve_images=named("training", inputs.training),
        overlays=[Overlay(*what, path) for what, path in named("overlays", inputs.overlays)],
        videos=named("videos", inputs.videos),
        timelines=named("videos", inputs.timelines),
        frames=pd.DataFrame(snakemake.params.frames, columns=list(FRAME_COLUMNS)),
        regressors=pd.DataFrame(snakemake.params.regressors, columns=list(REGRESSOR_COLUMNS)),
        settings=settings(cfg),
    )
    folder = Path(snakemake.output.page).parent
    with atomic_path(snakemake.output.page) as temporary:
        temporary.write_text(summary_page(found, limit_mb, folder), encoding="utf-8")


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
