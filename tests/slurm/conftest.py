"""The cluster that the tests of this folder share, and projects to run on it."""

import os
import shutil

import pytest

from tests.slurm import accounting
from tests.slurm.cluster import Cluster, why_not
from tests.slurm.runs import HELD, RIG_SCRIPT, RIGS, ROOT, WITH_ACCOUNTING, Copy, files_of

#: Nothing: no test; `sample`: a few of them; `1`: all, with the captures alone compared; `all`: everything compared.
WANTED = os.environ.get("VERMILION_TEST_SLURM", "")
SAMPLE = (
    "test_results_are_those_of_a_local_run[slurm-generic]",
    "test_jobs_of_a_killed_snakemake_are_cancelled_by_the_next_run[slurm]",
    "test_a_controller_that_is_started_again_ends_no_run[slurm]",
    "test_jobs_refuse_code_that_was_edited_after_the_run_began[slurm-generic]",
    "test_what_sbatch_refuses[slurm-generic]",
)


def pytest_collection_modifyitems(items):
    here = [item for item in items if ROOT / "tests" / "slurm" in item.path.parents]
    for item in here:
        item.add_marker(pytest.mark.slow)
        if not WANTED:
            item.add_marker(pytest.mark.skip(reason="make test-slurm starts a real Slurm"))
        elif WANTED == "sample" and item.name not in SAMPLE:
            item.add_marker(pytest.mark.skip(reason="not of the sample"))


@pytest.fixture(scope="session")
def cluster(tmp_path_factory):
    """A Slurm of two nodes."""
    reason = why_not() or (accounting.why_not() if WITH_ACCOUNTING else None)
    if reason:
        pytest.skip(reason) if WANTED == "sample" else pytest.fail(reason)
    with Cluster(tmp_path_factory.mktemp("slurm"), accounting=WITH_ACCOUNTING) as running:
        yield running


@pytest.fixture
def project(tmp_path):
    """A copy of the project in which nothing has run."""
    return Copy.of(ROOT, tmp_path / "project")


@pytest.fixture(scope="session")
def with_rigs(tmp_path_factory):
    """A copy in which the rigs were made without a cluster; their script can be held."""
    made = Copy.of(ROOT, tmp_path_factory.mktemp("rigs") / "project")
    first = "begin_job(snakemake.log[0], __file__, snakemake.params.code)"
    made.edit(RIG_SCRIPT, first, first + HELD)
    run = made.run(*RIGS, "--cores", "2")
    assert run.returncode == 0, run.stdout[-3000:]
    return made


@pytest.fixture
def rigs(with_rigs, cluster, tmp_path):
    """A copy in which only the rigs are missing, and the files that they must become."""
    project = Copy.of(with_rigs.folder, tmp_path / "project")
    expected = files_of(project.results)
    for name in ("captures", "truth"):
        shutil.rmtree(project.results / name)
    (project.folder / "started.txt").unlink()
    yield project, expected
    project.stop()
    cluster.clear()
