"""Slurm jobs of a run that was killed are found by their name or comment, and cancelled."""

import pytest

from vermilion.app.orphaned_jobs import cancel_jobs, jobs_of_run, name_for
from vermilion.storage.errors import InputError


@pytest.fixture
def slurm(tmp_path, monkeypatch):
    """Commands of a Slurm that shows what stands in a file; `scancel` empties it."""
    queue = tmp_path / "queue"
    commands = {"squeue": f"cat {queue}", "scancel": f"echo $@ > {tmp_path}/cancelled; : > {queue}"}
    for name, does in commands.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{does}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    return queue


def test_only_jobs_of_the_same_results_are_orphans(slurm):
    mine, other = name_for("results/mine"), name_for("results/other")
    slurm.write_text(
        f"1|{mine}_ab-cd|rule_features\n2|features|{mine}\n3|{other}|x\n4|shell|(null)\n"
    )
    assert jobs_of_run(mine) == ["1", "2"]


def test_a_name_is_one_of_a_place_not_of_how_it_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert name_for("results/mine") == name_for(tmp_path / "results" / "mine")
    assert len(name_for("results/mine")) <= 50  # what the plugin takes as a prefix


def test_cancelling_waits_until_the_jobs_have_ended(slurm):
    slurm.write_text("7\n8\n")
    cancel_jobs(["7"])
    assert (slurm.parent / "cancelled").read_text() == "7\n"


def test_a_job_that_does_not_end_is_named(slurm):
    (slurm.parent / "scancel").write_text("#!/bin/sh\n")
    slurm.write_text("7\n8\n")
    with pytest.raises(InputError, match="Slurm jobs 7 of an earlier run that go on after scancel"):
        cancel_jobs(["7"], within_s=0.0)
