"""All measures of all takes, the takes together, and table 1 of Lips16."""

import pandas as pd

from vermilion.config.evaluation import MeasuresConfig
from vermilion.evaluation.comparisons import comparisons, questions_of, rbf_and_affine
from vermilion.evaluation.files import load_sums
from vermilion.evaluation.kind_errors import kind_rows
from vermilion.evaluation.measures import COLUMNS, seconds_rows
from vermilion.evaluation.pooled import groups_of, pooled_rows
from vermilion.provenance.begun_run import begin_job
from vermilion.report.feature_tables import estimators, table2, table3
from vermilion.report.figures import plot_figure16, plot_table1
from vermilion.report.headline import headline
from vermilion.report.table1 import table1
from vermilion.storage.tables import read_table, write_table


def main(snakemake):
    options = MeasuresConfig(**snakemake.params.cfg["evaluation.measures"])
    pooled = (options.bootstrap_samples, options.confidence, options.seed)
    takes = [load_sums(path) for path in snakemake.input.takes]
    reconstructions = [load_sums(path) for path in snakemake.input.reconstructions]
    tables = [pd.DataFrame(columns=list(COLUMNS))]
    for group, members in groups_of([take["role"] for take in snakemake.params.takes]).items():
        tables.append(pooled_rows([takes[index] for index in members], *pooled, group))
    tables.append(pooled_rows(reconstructions, *pooled))
    tables += [read_table(path, COLUMNS) for path in snakemake.input.tables]
    measures = pd.concat([table for table in tables if len(table)] or tables[:1], ignore_index=True)
    write_table(snakemake.output.measures, measures)
    names = [take["take"] for take in snakemake.params.takes]
    frames = dict(zip(names, (count for _, count in takes), strict=True))
    seconds = [read_table(path) for path in snakemake.input.seconds]
    write_table(snakemake.output.seconds, seconds_rows(seconds, frames))
    write_table(snakemake.output.kinds, kind_rows(takes, *pooled))
    summary = table1(measures)
    write_table(snakemake.output.table1, summary)
    configured = snakemake.params.cfg["training.regressor"]
    curves = [read_table(path) for path in snakemake.input.curves]
    compared = comparisons(takes, questions_of(configured), *pooled)
    write_table(snakemake.output.comparisons, compared)
    write_table(snakemake.output.headline, headline(measures, compared))
    write_table(snakemake.output.table2, table2(curves, measures))
    write_table(snakemake.output.table3, table3(summary))
    write_table(snakemake.output.estimators, estimators(curves, measures, summary, configured))
    tables = [read_table(path) for path in snakemake.input.frames]
    over_time = dict(zip(names, tables, strict=True))
    plot_figure16(over_time, rbf_and_affine(configured), snakemake.output.figure16)
    plot_table1(summary, snakemake.output.image)
    print(summary.to_string())


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
