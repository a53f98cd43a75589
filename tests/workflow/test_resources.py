"""What jobs ask a cluster for covers what they were measured to use."""

import re

import pandas as pd
import pytest

#: Memory of the two processes of Snakemake round a script of a Slurm job.
SNAKEMAKE_MB = 270


def requests(printed):
    """Benchmark file -> (memory in MB, minutes) of every job that a dry run prints."""
    found = {}
    for block in re.split(r"\n(?:local)?rule ", printed):
        named = re.search(r"^    benchmark: (\S+)$", block, re.MULTILINE)
        memory = re.search(r"\bmem_mb=(\d+)", block)
        minutes = re.search(r"\bruntime=(\d+)", block)
        if named and memory and minutes:
            found[named[1]] = (int(memory[1]), int(minutes[1]))
    return found


@pytest.mark.slow
def test_every_job_asks_for_half_as_much_again_as_it_used(finished):
    run = finished.snakemake("--dry-run", "--forceall")
    asked = requests(run.stdout + run.stderr)
    assert len(asked) > 100
    short = []
    for name, (memory_mb, minutes) in asked.items():
        used = pd.read_csv(finished.folder / name, sep="\t", na_values="-").iloc[0]
        if memory_mb < 1.5 * used["max_rss"] + SNAKEMAKE_MB or 60 * minutes < 1.5 * used["s"]:
            short.append(f"{name}: asks for {memory_mb} MB, {minutes} min; used {used.to_dict()}")
    assert short == []
