"""SIGKILL at any moment: the same command goes on, and its results are those of an undisturbed run, bit for bit."""

import os
import shutil
from pathlib import Path

import pytest

from tests.workflow.conftest import Project, copy_project
from tests.workflow.disturbed_run import DisturbedRun, Results

pytestmark = pytest.mark.slow

SAMPLE = 3
ALL = int(os.environ.get("VERMILION_KILLS", "0"))
SEED = int(os.environ.get("VERMILION_KILLS_SEED", "1"))


def test_a_few_kills_of_a_finished_run(finished, tmp_path):
    """Part of the results is made again under kills."""
    expected = Results(finished.results).digests()
    project = Project(tmp_path / "project", finished.configuration)
    shutil.copytree(finished.folder, project.folder, symlinks=True)
    run = DisturbedRun(project, expected, SEED)
    run.kill(SAMPLE, pauses_s=(3.0,))
    run.complete()
    assert run.kills.total() == SAMPLE and run.completed >= 1


@pytest.mark.skipif(not ALL, reason="make test-kills: about an hour")
def test_kills_over_the_whole_graph(tmp_path_factory):
    """Parts of the whole tiny run, from rendering to the report, until there were VERMILION_KILLS kills."""
    kept = os.environ.get("VERMILION_KILLS_FOLDER")
    place = Path(kept) if kept else tmp_path_factory.mktemp("kills")
    undisturbed = Project(place / "undisturbed")
    if not undisturbed.folder.is_dir():
        (place / "making").mkdir(parents=True)
        copy_project(place / "making").snakemake("--cores", "1")
        (place / "making").rename(undisturbed.folder)
    shutil.rmtree(place / "disturbed", ignore_errors=True)
    shutil.copytree(undisturbed.folder, place / "disturbed", symlinks=True)
    expected = Results(undisturbed.results).digests()
    run = DisturbedRun(Project(place / "disturbed"), expected, SEED, ("--cores", "1"))
    run.kill(ALL)
    run.finish()
    print(f"kills: {dict(run.kills)}; parts: {run.completed}; at work: {dict(run.stages)}")
