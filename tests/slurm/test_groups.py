"""Chains of small jobs that ride together: fewer jobs of Slurm, and less time."""

import re
import subprocess
import sys
import time

SNAKEFILE = """
CHUNKS = range(8)


rule all:
    input:
        expand("second_{n}.txt", n=CHUNKS),


rule first:
    output:
        "first_{n}.txt",
    shell:
        "echo {wildcards.n} > {output}"


rule second:
    input:
        "first_{n}.txt",
    output:
        "second_{n}.txt",
    shell:
        "cat {input} > {output}"
"""
GROUPS = ["--groups", "first=chunk", "second=chunk"]


def run(folder, *options, timeout=600):
    """(Seconds, jobs of Slurm, what was printed) of a run of the chains."""
    folder.mkdir()
    (folder / "Snakefile").write_text(SNAKEFILE)
    words = [sys.executable, "-m", "snakemake", "--executor", "slurm", "--jobs", "100"]
    words += ["--slurm-status-command", "squeue", "--slurm-no-account", "--default-resources"]
    words += ["slurm_partition=main", "mem_mb=500", "runtime=5"]
    words += ["--slurm-init-seconds-before-status-checks", "5", *options]
    start = time.monotonic()
    ended = subprocess.run(
        words, cwd=folder, capture_output=True, text=True, timeout=timeout, check=False
    )
    printed = ended.stdout + ended.stderr
    assert ended.returncode == 0, printed[-3000:]
    numbers = set(re.findall(r"SLURM jobid (\d+(?:_\d+)?)", printed))
    return time.monotonic() - start, len(numbers), printed


def test_a_group_is_one_job_and_takes_less_time(cluster, tmp_path):
    alone_s, alone, _ = run(tmp_path / "alone")
    together_s, together, _ = run(tmp_path / "together", *GROUPS)
    print(f"alone: {alone} jobs, {alone_s:.0f} s; in groups: {together} jobs, {together_s:.0f} s")
    assert (alone, together) == (16, 8)
    assert together_s < alone_s
