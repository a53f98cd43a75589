"""Error maps from front and side, and curves over time, of a take."""

from vermilion.config.evaluation import FiguresConfig
from vermilion.evaluation.figures import curves, error_maps
from vermilion.evaluation.files import load_arrays
from vermilion.images import write_srgb8
from vermilion.logfile import log_to
from vermilion.tables import read_table


def main(snakemake):
    cfg = FiguresConfig(**snakemake.params.cfg["evaluation.figures"])
    maps = load_arrays(snakemake.input.maps)
    names = maps["regressors"].tolist()
    picture = error_maps(
        dict(zip(names, maps["meshes_mm"], strict=True)),
        dict(zip(names, maps["errors_mm"], strict=True)),
        maps["triangles"],
        maps["mouth"],
        maps["frames"],
        cfg.error_scale_mm,
        cfg.map_size_px,
    )
    write_srgb8(snakemake.output.maps, picture)
    title = f"{snakemake.wildcards.subject}/{snakemake.wildcards.take}"
    curves(read_table(snakemake.input.frames), title, snakemake.output.curves)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
