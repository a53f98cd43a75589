"""The tiny capture on a real Slurm of two nodes: the same bytes as a local run.

`make test-slurm` runs the tests of this folder; they are not part of `make test`, as they need root and
Slurm's daemons.
"""

import os
import time

import pytest

from tests.slurm.runs import ROOT, Copy, different, files_of, on

#: What the comparison covers: the captures; VERMILION_TEST_SLURM=all: everything.
TARGET = "all" if os.environ.get("VERMILION_TEST_SLURM") == "all" else "captures"


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Results of a run without a cluster: relative path -> bytes."""
    project = Copy.of(ROOT, tmp_path_factory.mktemp("local") / "project")
    run = project.run(TARGET, "--cores", "2")
    assert run.returncode == 0, run.stdout[-3000:]
    return files_of(project.results)


@pytest.mark.parametrize("profile", ["slurm", "slurm-generic"])
def test_results_are_those_of_a_local_run(local, project, profile, request):
    cluster = request.getfixturevalue("cluster")  # after the local run, which needs the cores
    start = time.monotonic()
    remote = project.run(TARGET, *on(profile))
    assert remote.returncode == 0, remote.stdout[-3000:]
    print(f"{profile}: {time.monotonic() - start:.0f} s")
    assert different(files_of(project.results), local) == []
    assert cluster.jobs() == []
