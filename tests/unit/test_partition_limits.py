"""Jobs that a Slurm partition can never start are found before they are submitted."""

import stat

import pytest

from vermilion.app.partition_limits import (
    JobRequest,
    PartitionLimits,
    impossible_jobs,
    read_partitions,
)

LIMITS = {"main": PartitionLimits(minutes=60, mem_mb=8000, cores=2)}


def job(**changes):
    values = {"rule": "apply", "partition": "main", "minutes": 60, "mem_mb": 8000, "cores": 2}
    return JobRequest(**{**values, **changes})


def test_what_fits_exactly_can_start():
    assert impossible_jobs([job()], LIMITS) == []


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"minutes": 61}, "asks for runtime 61 min; partition 'main' allows 60 min"),
        ({"mem_mb": 8001}, "asks for mem_mb 8001 MB; partition 'main' allows 8000 MB"),
        ({"cores": 3}, "asks for threads 3; partition 'main' allows 2"),
        ({"partition": "big"}, "partition 'big', which this cluster does not have; it has main"),
    ],
)
def test_a_request_over_a_limit_is_a_sentence_with_a_remedy(changes, sentence):
    (found,) = impossible_jobs([job(**changes)], LIMITS)
    assert sentence in found and "rule apply" in found
    assert "slurm_partition" in found


def test_one_sentence_a_rule_names_its_worst_job():
    jobs = [job(minutes=70), job(minutes=90), job(minutes=80)]
    (found,) = impossible_jobs(jobs, LIMITS)
    assert "runtime 90 min" in found


def test_a_partition_without_a_time_limit_allows_any():
    limits = {"main": PartitionLimits(minutes=None, mem_mb=8000, cores=2)}
    assert impossible_jobs([job(minutes=100000)], limits) == []


def test_a_partition_that_refuses_jobs_is_named():
    limits = {"main": PartitionLimits(60, 8000, 2, "drain")}
    (found,) = impossible_jobs([job()], limits)
    assert "rule apply: partition 'main' takes no jobs now: it is drain" in found


def test_without_slurm_nothing_is_refused():
    assert impossible_jobs([job(partition="")], {}) == []


def test_limits_are_those_of_the_largest_node(tmp_path, monkeypatch):
    rows = (
        "main|1:00:00|8000|2|up",
        "main|1:00:00|16000+|8|up",
        "long|2-00:30:00|8000|2|inactive",
        "free|infinite|8000|2|up",
    )
    listing = "\\n".join(rows)
    fake = tmp_path / "sinfo"
    fake.write_text(f"#!/bin/sh\nprintf '{listing}'\n")
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert read_partitions() == {
        "main": PartitionLimits(60, 16000, 8),
        "long": PartitionLimits(2 * 24 * 60 + 30, 8000, 2, "inactive"),
        "free": PartitionLimits(None, 8000, 2),
    }
