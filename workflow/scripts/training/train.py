"""One regressor, its cross-validation curve and that curve's image."""

from vermilion.config.regressors import GENERIC, trained_on
from vermilion.config.training import TrainingConfig
from vermilion.database.read import LipDatabase
from vermilion.provenance.begun_run import begin_job
from vermilion.regression.model import save_model
from vermilion.regression.training import Selection, curve_table, train
from vermilion.report.cross_validation import plot_curve
from vermilion.storage.tables import write_table


def main(snakemake):
    name, output = snakemake.wildcards.regressor, snakemake.output
    selection = Selection(**TrainingConfig(**snakemake.params.cfg["training"]).model_dump())
    with LipDatabase(snakemake.input.database) as database:
        data = database.training_set(trained_on(name, database.subjects))
        place = (
            database.feature_names, database.mask, database.area_mm2, database.topology,
            database.vertices,
        )  # fmt: skip
    model, curve = train(name, data, *place, selection)
    table = curve_table(name, curve, selection.choice)
    print(table.to_string())
    write_table(output.curve, table)
    plot_curve(output.image, name, curve, selection.choice)
    save_model(output.model, model, compact=name == GENERIC)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
