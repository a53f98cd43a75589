"""SIGKILL at any moment: the same command goes on, and its results are those of an undisturbed run, bit for bit."""

import os
import shutil
from pathlib import Path

import pytest

from tests.workflow.conftest import copy_project
from tests.workflow.disturbed_run import DisturbedRun, Results

pytestmark = pytest.mark.slow

SAMPLE = 5
ALL = int(os.environ.get("VERMILION_KILLS", "0"))
SEED = int(os.environ.get("VERMILION_KILLS_SEED", "1"))


def test_a_few_kills_of_a_finished_run(finished):
    """Part of the results is made again under kills."""
    expected = Results(finished.results).digests()
    run = DisturbedRun(finished, expected, SEED)
    run.completed = 1
    run._remove_some()
    run.kill(SAMPLE, pauses_s=(4.0,))
    run.finish()


@pytest.mark.skipif(not ALL, reason="make test-kills: about an hour")
def test_kills_over_the_whole_graph(tmp_path_factory):
    """From nothing, over and over, until there were VERMILION_KILLS kills."""
    kept = os.environ.get("VERMILION_KILLS_FOLDER")
    place = Path(kept) if kept else tmp_path_factory.mktemp("kills")
    place.mkdir(parents=True, exist_ok=True)
    if not (place / "expected").is_dir():
        shutil.rmtree(place / "undisturbed", ignore_errors=True)
        (place / "undisturbed").mkdir()
        project = copy_project(place / "undisturbed")
        project.snakemake("--cores", "1")
        shutil.copytree(project.results, place / "expected", symlinks=True)
    expected = Results(place / "expected").digests()
    shutil.rmtree(place / "disturbed", ignore_errors=True)
    (place / "disturbed").mkdir()
    project = copy_project(place / "disturbed")
    run = DisturbedRun(project, expected, SEED, ("--cores", "1"))
    run.kill(ALL)
    run.finish()
    print(f"{dict(run.kills)}; complete {run.completed} times")
