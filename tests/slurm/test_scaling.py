"""Two nodes do the jobs of one in little more than half the time: what Snakemake and Slurm add does not grow.

The jobs wait instead of computing, so that the figure is of the workflow and not of a machine that others use.
"""

import subprocess
import sys
import time

from tests.slurm.runs import ROOT

SNAKEFILE = """
rule all:
    input:
        expand("{n}.txt", n=range(8)),


rule work:
    output:
        "{n}.txt",
    shell:
        "sleep 15; touch {output}"
"""


def seconds(folder, partition):
    """How long the eight jobs take on the nodes of a partition."""
    folder.mkdir()
    (folder / "Snakefile").write_text(SNAKEFILE)
    (folder / "profiles").symlink_to(ROOT / "profiles")
    words = [sys.executable, "-m", "snakemake", "--workflow-profile", "profiles/slurm-generic"]
    words += ["--default-resources", f"slurm_partition={partition}", "mem_mb=500", "runtime=5"]
    start = time.monotonic()
    ended = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=900)
    assert ended.returncode == 0, ended.stderr[-3000:]
    return time.monotonic() - start


def test_two_nodes_are_at_least_1_8_times_one(cluster, tmp_path):
    subprocess.run(["scontrol", "update", "PartitionName=closed", "State=UP"], check=True)
    one_s, two_s = seconds(tmp_path / "one", "closed"), seconds(tmp_path / "two", "main")
    print(f"8 jobs of 15 s: one node {one_s:.0f} s, two nodes {two_s:.0f} s")
    assert one_s / two_s >= 1.8
