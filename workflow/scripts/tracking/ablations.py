"""The photometric residuals of all takes and steps as one table."""

from pathlib import Path

import pandas as pd

from vermilion.provenance.begun_run import begin_job
from vermilion.storage.tables import read_table, write_table
from vermilion.tracking.image_fit.ablations import ablation_rows


def main(snakemake):
    parts = []
    for path in map(Path, snakemake.input.tables):
        # .../takes/<subject>/<take>/tracking/residuals/<step>/<chunk>.tsv
        subject, take = path.parts[-6:-4]
        rows = read_table(path, ["frame", "residual"])
        parts.append(rows.assign(subject=subject, take=take, step=path.parent.name))
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    write_table(snakemake.output.table, ablation_rows(table))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
