"""The tiny capture on a real Slurm of two nodes: the same bytes as a local run, and no job that waits for ever.

`make test-slurm` runs it; it is not part of `make test`, as it needs root and Slurm's daemons.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.slurm.cluster import Cluster, why_not

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not os.environ.get("VERMILION_TEST_SLURM"), reason="make test-slurm starts a real Slurm"
    ),
]
#: Stages that the comparison covers, from rendering to H; VERMILION_TEST_SLURM=all: everything.
SOME = ["captures"]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    reason = why_not()
    if reason:
        pytest.fail(reason)
    with Cluster(tmp_path_factory.mktemp("slurm")) as running:
        yield running


@pytest.fixture
def project(tmp_path):
    """A copy of the workflow, as two users of a cluster would have."""
    folder = tmp_path / "project"
    ignore = shutil.ignore_patterns(
        ".git", ".venv*", "results", ".snakemake", "__pycache__", "docs"
    )
    shutil.copytree(ROOT, folder, ignore=ignore)
    return folder


def snakemake(project, *arguments, timeout=3000):
    environment = {**os.environ, "PYTHONPATH": str(project / "src")}
    return subprocess.run(
        [sys.executable, "-m", "snakemake", *arguments, "--configfile", "config/tiny.yaml"],
        cwd=project,
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout,
    )


def files_of(folder):
    """Relative path -> bytes, of every result that is no log, time or overlay of a run."""
    skipped = {"logs", "benchmarks"}
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not skipped & set(path.relative_to(folder).parts)
    }


def targets():
    return ["all"] if os.environ["VERMILION_TEST_SLURM"] == "all" else SOME


@pytest.mark.parametrize("profile", ["slurm", "slurm-generic"])
def test_results_are_those_of_a_local_run(cluster, project, profile):
    local = snakemake(project, *targets(), "--cores", "2")
    assert local.returncode == 0, local.stderr[-3000:]
    results = project / "results" / "tiny"
    expected = files_of(results)
    shutil.move(results, project / "local")
    remote = snakemake(
        project,
        *targets(),
        "--workflow-profile",
        f"profiles/{profile}",
        "--config",
        "chunk_frames=8",
    )
    assert remote.returncode == 0, remote.stderr[-3000:]
    found = files_of(results)
    assert set(found) - {"checksums.tsv"} == set(expected) - {"checksums.tsv"}
    assert [
        name for name in expected if name != "checksums.tsv" and found[name] != expected[name]
    ] == []
    assert cluster.jobs() == []


@pytest.mark.parametrize("profile", ["slurm", "slurm-generic"])
def test_a_job_that_could_never_start_ends_the_run_with_a_sentence(cluster, project, profile):
    run = snakemake(
        project,
        "captures",
        "--workflow-profile",
        f"profiles/{profile}",
        "--default-resources",
        "slurm_partition=short",
        "runtime=60",
        "mem_mb=500",
        timeout=300,
    )
    assert run.returncode != 0
    assert "partition 'short' allows 5 min" in run.stderr + run.stdout
    assert cluster.jobs() == []
