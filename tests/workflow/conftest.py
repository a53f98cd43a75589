"""Working copies of the project: a fresh one, and one in which a tiny capture was run to its end."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("Snakefile", "config", "profiles", "workflow", "src")
#: What numba and Python write beside their compiled files, and rename.
BEING_WRITTEN = shutil.ignore_patterns("*.tmp.*", "*.pyc.*")


@dataclass(frozen=True)
class Project:
    """A working copy with its own library, configuration and results."""

    folder: Path
    configuration: str = "config/tiny.yaml"

    @property
    def results(self) -> Path:
        return (
            self.folder / yaml.safe_load((self.folder / self.configuration).read_text())["results"]
        )

    def command(self, *arguments: str) -> list[str]:
        base = [sys.executable, "-m", "snakemake", "--configfile", self.configuration]
        return [*base, "--cores", "2", *arguments]

    def environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "PYTHONPATH": str(self.folder / "src"),
            "PYTHONDONTWRITEBYTECODE": "",
        }

    def snakemake(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess:
        """Run Snakemake in this copy."""
        run = subprocess.run(
            self.command(*arguments),
            cwd=self.folder,
            env=self.environment(),
            text=True,
            capture_output=True,
            check=False,
        )
        if check and run.returncode:
            raise AssertionError(f"snakemake {arguments}:\n{run.stdout}\n{run.stderr[-6000:]}")
        return run

    def would_run(self, *arguments: str) -> dict[str, int]:
        """Rule -> number of jobs that a run would start, without the target rule."""
        run = self.snakemake("--dry-run", *arguments)
        printed = run.stdout + run.stderr
        if "Job stats:" not in printed:
            assert "Nothing to be done" in printed, printed[-3000:]
            return {}
        table = printed.split("Job stats:")[1].split("\ntotal")[0]
        jobs = dict(re.findall(r"^(\w+)\s+(\d+)$", table, flags=re.MULTILINE))
        return {rule: int(count) for rule, count in jobs.items() if rule != "all"}

    def edit_configuration(self, change) -> None:
        """Apply `change` to the configuration as a dict, and write it back."""
        path = self.folder / self.configuration
        content = yaml.safe_load(path.read_text())
        change(content)
        path.write_text(yaml.safe_dump(content))


def copy_project(folder: Path) -> Project:
    """Copy what a run needs, without results; with what is compiled already, so that no job does it again."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=BEING_WRITTEN)
        else:
            shutil.copy(source, folder / name)
    return Project(folder)


def use_as_captures(project: Project) -> Project:
    """A configuration for which the studio's captures are captures like any other.

    They are moved out of the results, the take sheet names their folders, and the truth lies where
    the configuration of the evaluation says.
    """
    made = project.folder / "results" / "studio"
    for name in ("captures", "truth"):
        shutil.move(made / name, project.folder / name)
    sheet = (project.folder / "config" / "takes.tiny.tsv").read_text().splitlines()
    rows = [sheet[0]]
    for line in sheet[1:]:
        cells = line.split("\t")
        cells[3] = f"captures/{cells[0]}/{cells[1]}"
        rows.append("\t".join(cells))
    (project.folder / "config" / "takes.external.tsv").write_text("\n".join(rows) + "\n")
    content = yaml.safe_load((project.folder / "config" / "tiny.yaml").read_text())
    content.update(results="results/external", takes="config/takes.external.tsv")
    del content["studio"]
    content.setdefault("evaluation", {})["truth"] = "truth"
    (project.folder / "config" / "external.yaml").write_text(yaml.safe_dump(content))
    return Project(project.folder, "config/external.yaml")


@pytest.fixture(scope="session")
def fresh_project(tmp_path_factory) -> Project:
    """A copy in which nothing has run."""
    return copy_project(tmp_path_factory.mktemp("fresh"))


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Project:
    """A copy in which a tiny capture has been run to its end. Tests leave it as they found it.

    The run is made once for all processes that share the tests (pytest-xdist); each has its own copy.
    """
    here = tmp_path_factory.getbasetemp()
    shared = here.parent if "PYTEST_XDIST_WORKER" in os.environ else here
    made = shared / "finished"
    with open(shared / "finished.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not made.is_dir():
            folder = tmp_path_factory.mktemp("running")
            project = copy_project(folder)
            project.snakemake("captures", "--config", "results=results/studio")
            use_as_captures(project).snakemake()
            folder.rename(made)
        shutil.copytree(made, here / "finished_copy", symlinks=True)
    return Project(here / "finished_copy", "config/external.yaml")
