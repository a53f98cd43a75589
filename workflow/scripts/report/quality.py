"""Every flagged frame of every stage, with the reason; takes that were left out."""

import pandas as pd

from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import COLUMNS, flagged_frames
from vermilion.storage.tables import write_table


def main(snakemake):
    flagged = flagged_frames(snakemake.input.tables)
    rows = [{"stage": "run", "valid": 0, **row} for row in snakemake.params.skipped]
    left_out = pd.DataFrame(rows, columns=list(COLUMNS))
    table = pd.concat([left_out, flagged], ignore_index=True) if rows else flagged
    write_table(snakemake.output.flagged, table)
    print(table.to_string())


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
