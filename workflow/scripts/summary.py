"""Every result on one HTML page that opens offline."""

from pathlib import Path

import pandas as pd

from vermilion.evaluation.summary import FRAME_COLUMNS, Findings, Overlay, summary_page
from vermilion.files import atomic_path
from vermilion.logfile import log_to
from vermilion.tables import read_table


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

    found = Findings(
        measures=read_table(inputs.measures),
        table1=read_table(inputs.table1),
        kinds=read_table(inputs.kinds),
        flagged=read_table(inputs.quality),
        table1_picture=Path(inputs.picture),
        error_maps=named("maps", inputs.maps),
        over_time=named("maps", inputs.curves),
        curve_pictures=named("training", inputs.training),
        overlays=[Overlay(*what, path) for what, path in named("overlays", inputs.overlays)],
        videos=named("videos", inputs.videos),
        timelines=named("videos", inputs.timelines),
        frames=pd.DataFrame(snakemake.params.frames, columns=list(FRAME_COLUMNS)),
        settings=settings(cfg),
    )
    with atomic_path(snakemake.output.page) as temporary:
        temporary.write_text(summary_page(found, limit_mb), encoding="utf-8")


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
