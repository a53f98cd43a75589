"""A job that can never start ends the run with a sentence, and leaves no job behind."""

import subprocess

import pytest

from tests.slurm.runs import RIGS, on

BOTH = pytest.mark.parametrize("profile", ["slurm", "slurm-generic"])


def refused(project, cluster, *options, **environment):
    """What a run says that cannot submit its jobs."""
    run = project.run(RIGS[0], *options, timeout=90, **environment)
    assert run.returncode != 0
    assert cluster.jobs() == []
    return run.stdout


@BOTH
@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ("runtime=61", "runtime 61 min; partition 'main' allows 60 min"),
        ("mem_mb=9000", "mem_mb 9000 MB; partition 'main' allows 8000 MB"),
        ("slurm_partition=short", "runtime 30 min; partition 'short' allows 5 min"),
        ("slurm_partition=big", "partition 'big', which this cluster does not have"),
    ],
)
def test_a_request_over_a_limit(cluster, rigs, profile, asked, sentence):
    project, _ = rigs
    options = [*on(profile), "--set-resources", f"studio_rig_s1_plain:{asked}"]
    assert sentence in refused(project, cluster, *options)


@BOTH
def test_a_partition_that_takes_no_jobs(cluster, rigs, profile):
    project, _ = rigs
    options = [*on(profile), "--set-resources", "studio_rig_s1_plain:slurm_partition=closed"]
    subprocess.run(["scontrol", "update", "PartitionName=closed", "State=INACTIVE"], check=True)
    assert "partition 'closed' takes no jobs now: it is inactive" in refused(
        project, cluster, *options
    )


@BOTH
def test_what_sbatch_refuses(cluster, rigs, profile):
    project, _ = rigs
    said = refused(project, cluster, *on(profile), SBATCH_RESERVATION="nobody")
    assert "reservation" in said.lower()
    assert "studio_rig_s1_plain" in said
