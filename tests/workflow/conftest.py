"""A copy of the project in which the tiny configuration has been run to its end."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("Snakefile", "config", "profiles", "workflow", "src")


@dataclass(frozen=True)
class Project:
    """A working copy with its own library, configuration and results."""

    folder: Path

    @property
    def results(self) -> Path:
        return self.folder / "results" / "tiny"

    def snakemake(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess:
        """Run Snakemake on the tiny configuration in this copy."""
        run = subprocess.run(
            self.command(*arguments), cwd=self.folder, env=self.environment(), text=True,
            capture_output=True, check=False,
        )  # fmt: skip
        if check and run.returncode:
            raise AssertionError(f"snakemake {arguments}:\n{run.stdout}\n{run.stderr[-6000:]}")
        return run

    def command(self, *arguments: str) -> list[str]:
        base = [sys.executable, "-m", "snakemake", "--configfile", "config/tiny.yaml"]
        return [*base, "--cores", "2", *arguments]

    def environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "PYTHONPATH": str(self.folder / "src"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }

    def would_run(self, *arguments: str) -> dict[str, int]:
        """Rule -> number of jobs that a run would start, without the target rules."""
        printed = self.snakemake("--dry-run", *arguments).stdout
        if "Nothing to be done" in printed:
            return {}
        table = printed.split("Job stats:")[1].split("total")[0]
        jobs = dict(re.findall(r"^(\w+)\s+(\d+)$", table, flags=re.MULTILINE))
        return {rule: int(count) for rule, count in jobs.items() if rule != "all"}


def copy_project(folder: Path) -> Project:
    """Copy what a run needs, without results."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    return Project(folder)


@pytest.fixture(scope="session")
def fresh_project(tmp_path_factory) -> Project:
    """A copy in which nothing has run."""
    return copy_project(tmp_path_factory.mktemp("fresh"))


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Project:
    """A copy in which the tiny configuration has run to its end. Tests leave it as it was."""
    project = copy_project(tmp_path_factory.mktemp("finished"))
    project.snakemake()
    return project
