"""The workflow as a module of another one, as snakedeploy writes it."""

import shutil
import sys

import pytest

from .conftest import ROOT, Project

OTHER_WORKFLOW = """
configfile: "config/tiny.yaml"

module vermilion:
    snakefile:
        "{snakefile}"
    config:
        config

use rule * from vermilion
"""


class Deployed(Project):
    """A folder with a configuration and the workflow that takes ours in; no copy of the code."""

    def command(self, *arguments: str) -> list[str]:
        return [sys.executable, "-m", "snakemake", "--cores", "2", *arguments]

    def environment(self) -> dict[str, str]:
        return {**super().environment(), "PYTHONPATH": str(ROOT / "src")}


@pytest.mark.slow
def test_another_workflow_takes_this_one_in(tmp_path, fresh_project):
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "Snakefile").write_text(OTHER_WORKFLOW.format(snakefile=ROOT / "Snakefile"))
    deployed = Deployed(tmp_path)
    assert deployed.would_run() == fresh_project.would_run()
    # A job finds its script and its folder: results lie beside the workflow that runs.
    face = "results/tiny/face_model/tracker.npz"
    deployed.snakemake(face)
    assert (tmp_path / face).is_file()
