"""The shared cache never gives one job the result of another."""

import os
import subprocess
import sys

import pytest

SNAKEFILE = """
from vermilion.provenance.cache import roles_of, wildcards_of


rule all:
    input:
        "x.out",
        "y.out",
        "x.swapped.out",


rule made:
    input:
        first="same1.txt",
        second="same2.txt",
    output:
        "{name}.out",
    wildcard_constraints:
        name="[xy]",
    cache: True
    params:
        WC
    script:
        "made.py"


rule swapped:
    input:
        first="same2.txt",
        second="same1.txt",
    output:
        "{name}.swapped.out",
    wildcard_constraints:
        name="[xy]",
    cache: True
    params:
        WC
    script:
        "made.py"
"""
SCRIPT = """
from pathlib import Path

first = Path(snakemake.input.first).read_text()
Path(snakemake.output[0]).write_text(f"{snakemake.wildcards.name} {first}")
"""


@pytest.mark.slow
def test_jobs_that_differ_by_wildcard_or_role_do_not_share(tmp_path):
    (tmp_path / "Snakefile").write_text(
        SNAKEFILE.replace("WC", "wc=wildcards_of,\n        roles=roles_of,")
    )
    (tmp_path / "made.py").write_text(SCRIPT)
    (tmp_path / "same1.txt").write_text("one")
    (tmp_path / "same2.txt").write_text("two")
    cache = tmp_path / "cache"
    cache.mkdir()
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--cache", "made", "swapped"]
    environment = {**os.environ, "SNAKEMAKE_OUTPUT_CACHE": str(cache)}
    run = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "x.out").read_text() == "x one"
    assert (tmp_path / "y.out").read_text() == "y one"
    assert (tmp_path / "x.swapped.out").read_text() == "x two"
    assert len([p for p in cache.rglob("*") if p.is_file() and p.stat().st_size]) >= 3
