"""What a generic regressor brings on synthetic people whom it has not seen, beside base and `null`.

Takes a finished run of `make generic`: people are held out whole, some at a time; the regressor is trained
on the others as the run's configuration says, and corrects the held-out people's videos as the configuration's
section `correction` says. Rows and measures are those of `unseen_subject`: means over people, and how many of
them the regressor makes worse than `null` (`worse`, of the lip motion).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from benchmarks.common import print_table
from benchmarks.finished_run import FinishedRun
from benchmarks.unseen_subject import figures, sequences_of, tracked_take, truth_of
from vermilion.baselines.null import null_model
from vermilion.config.correction import CorrectionConfig
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.config.evaluation import ReferenceConfig
from vermilion.config.load import read_keys
from vermilion.config.regressors import GENERIC
from vermilion.config.training import TrainingConfig
from vermilion.correspondence.correspondence import CorrespondenceSettings
from vermilion.correspondence.neutral import model_mouth_mask
from vermilion.database.read import LipDatabase
from vermilion.evaluation.masks import regions_of_mask
from vermilion.evaluation.reference import MatchTolerance
from vermilion.regression.model import LipModel
from vermilion.regression.training import Selection, train


def trained(database: LipDatabase, people: list[str], selection: Selection) -> LipModel:
    """The generic regressor of some people of a database."""
    return train(
        GENERIC, database.training_set(people), database.feature_names, database.mask,
        database.area_mm2, database.topology, database.vertices, selection,
    )[0]  # fmt: skip


def measured(
    run: FinishedRun, models: dict[str, LipModel], keys: dict, fps: float, names: tuple[str, ...]
) -> pd.DataFrame:
    """A row a regressor for the person of a run: base, null, and the models."""
    model, take = run.tracker_model(), tracked_take(run, run.tracker_model())
    region = CorrespondenceConfig(**keys.get("correspondence", {})).model_dump(
        exclude={"landmarks"}
    )
    mask = model_mouth_mask(model, take.neutral_mm, CorrespondenceSettings(**region))
    near = MatchTolerance(**ReferenceConfig().model_dump())
    slight_open = keys.get("face_model", {}).get("template_slight_open", 0.09)
    truth = truth_of(run, take.frames, int(run.fit().frames[0]), None)
    against = truth.reference(run.model("tracker"), slight_open, near)
    everything = {"null": null_model(model.triangles, mask, names)} | models
    options = CorrectionConfig(**keys.get("correction", {}))
    sequences = sequences_of(take, everything, options, fps)
    regions = regions_of_mask(model, take.neutral_mm, mask)
    rows = figures(sequences, take.frames, model, regions, against)
    return pd.DataFrame(rows).assign(person=run.take.split("/")[0])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The run, and who is held out."""
    parser.add_argument("--results", type=Path, default=Path("results/generic"), metavar="FOLDER")
    parser.add_argument("--config", type=Path, default=Path("config/generic.yaml"), metavar="FILE")
    parser.add_argument("--folds", type=int, default=5, help="groups of people that are held out")
    parser.add_argument("--only", type=int, help="so many of the groups alone")
    parser.add_argument("--people", action="store_true", help="print a row a person too")


def run(arguments: argparse.Namespace) -> None:
    """Train, correct, measure and print."""
    keys = read_keys(arguments.config)
    selection = Selection(**TrainingConfig(**keys.get("training", {})).model_dump())
    tables = []
    with LipDatabase(arguments.results / "database" / "generic.h5") as database:
        takes = dict(database.takes)
        people = list(takes)
        fps = database.read_take(people[0], takes[people[0]]).fps
        for fold in range(arguments.folds)[: arguments.only]:
            held = people[fold :: arguments.folds]
            model = trained(database, [p for p in people if p not in held], selection)
            print(f"held out: {' '.join(held)}; {model.estimator.get_params()}", flush=True)
            for person in held:
                results = arguments.results
                one = FinishedRun(
                    results, f"{person}/{takes[person]}", results / "captures",
                    results / "truth" / person / takes[person],
                )  # fmt: skip
                tables.append(measured(one, {GENERIC: model}, keys, fps, model.feature_names))
    _print(pd.concat(tables), arguments.people)


def _print(table: pd.DataFrame, people: bool) -> None:
    if people:
        print_table(table)
    motion = table.pivot(index="person", columns="regressor", values="motion")
    means = table.drop(columns="person").groupby("regressor", sort=False).mean().reset_index()
    means["ratio"] = means["motion"] / means["motion"].iloc[0]
    worse = {name: int((motion[name] > motion["null"]).sum()) for name in motion}
    means["worse"] = [worse[name] for name in means["regressor"]]
    print(f"{len(motion)} people")
    print_table(means)
