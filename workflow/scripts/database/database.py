"""The training database from the layers and features of every take."""

from vermilion.config.database import DatabaseConfig
from vermilion.correction.neutral_pair import NeutralPair
from vermilion.correspondence.correspondence import Correspondence
from vermilion.database.gather import read_take_files
from vermilion.database.schema import SubjectEntry
from vermilion.database.write import write_database
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.progress import progress
from vermilion.tracking.result import Identity


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    cfg = DatabaseConfig(**params.cfg["database"])
    maps = dict(zip(params.subjects, map(Correspondence.load, inputs.correspondence), strict=True))
    people, pairs = map(Identity.load, inputs.identity), map(NeutralPair.load, inputs.neutral_pair)
    entries = [
        SubjectEntry(name, person.neutral_mm, found.mask, None if pair.reason else pair.features)
        for (name, found), person, pair in zip(maps.items(), people, pairs, strict=True)
    ]
    layers, features = iter(inputs.layers), iter(inputs.features)
    files = [
        (take, *([next(paths) for _ in range(take["chunks"])] for paths in (layers, features)))
        for take in params.takes
    ]
    first = next(iter(maps.values()))
    names = read_take_files(*files[0])[1]
    write_database(
        snakemake.output.database,
        first.coarse_triangles,
        names,
        entries,
        (read_take_files(*each)[0] for each in progress(files, "takes")),
        **cfg.model_dump(exclude={"generic_most_motion_mm"}),
    )


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
