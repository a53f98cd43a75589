"""Copies of the project and runs of it on the cluster, for tests."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import psutil

ROOT = Path(__file__).parents[2]
#: Three short jobs of one kind, of which two nodes of one core run two at once.
RIGS = [
    f"results/tiny/captures/{take}/cameras/cameras.txt"
    for take in ("s1/plain", "s1/rom", "s2/plain")
]
#: Whether the cluster has an accounting database, which the Slurm plugin then asks.
WITH_ACCOUNTING = bool(os.environ.get("VERMILION_SLURM_ACCOUNTING"))
RIG_SCRIPT = "workflow/scripts/studio/studio_rig.py"
#: What the rigs' script does first in these copies: it says that it runs, and waits while a test holds it.
HELD = """
    import os
    import time
    from pathlib import Path
    with open("started.txt", "a") as stream:
        node, asked = os.environ.get("SLURMD_NODENAME", "-"), snakemake.resources
        number = os.environ.get("SLURM_JOB_ID", "-")
        stream.write(f"{snakemake.rule} {node} {number} {asked.runtime} {asked.mem_mb}\\n")
    while Path("hold").exists():
        time.sleep(0.1)
"""


@dataclass(frozen=True)
class Copy:
    """A copy of the project, as each user of a cluster has."""

    folder: Path
    runs: list[subprocess.Popen] = field(default_factory=list)

    @classmethod
    def of(cls, source: Path, folder: Path) -> Copy:
        """Copy a project, with what it has compiled, without environments."""
        ignore = shutil.ignore_patterns(".git", ".venv*", "docs", "site", "locks", "*.tmp.*")
        if source == ROOT:
            ignore = shutil.ignore_patterns(
                ".git", ".venv*", "docs", "results", ".snakemake", "*.tmp.*"
            )
        shutil.copytree(source, folder, ignore=ignore, symlinks=True)
        return cls(folder)

    @property
    def results(self) -> Path:
        return self.folder / "results" / "tiny"

    def command(self, *arguments: str) -> list[str]:
        return [sys.executable, "-m", "snakemake", *arguments, "--configfile", "config/tiny.yaml"]

    def environment(self, **more: str) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": str(self.folder / "src"), **more}

    def run(self, *arguments: str, timeout: float = 3000, **environment: str):
        """Run Snakemake to its end; returns the finished process with what it printed."""
        return subprocess.run(
            self.command(*arguments),
            cwd=self.folder,
            env=self.environment(**environment),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout,
        )

    def start(self, *arguments: str) -> subprocess.Popen:
        """Start Snakemake, with what it prints in `printed.txt`."""
        with open(self.folder / "printed.txt", "w") as stream:
            run = subprocess.Popen(
                self.command(*arguments),
                cwd=self.folder,
                env=self.environment(),
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_let_be_interrupted,
            )
        self.runs.append(run)
        return run

    def stop(self) -> None:
        """End what a test that failed left running."""
        for run in self.runs:
            if run.poll() is None:
                kill(run)

    @property
    def printed(self) -> str:
        return (self.folder / "printed.txt").read_text()

    def started(self) -> list[list[str]]:
        """Rule, node, number, minutes and megabytes of each job of the rigs that has started."""
        path = self.folder / "started.txt"
        return [line.split() for line in path.read_text().splitlines()] if path.exists() else []

    def hold(self) -> None:
        """From now on the jobs of the rigs wait."""
        (self.folder / "hold").touch()

    def release(self) -> None:
        """The jobs of the rigs go on."""
        (self.folder / "hold").unlink()

    def edit(self, path: str, old: str, new: str) -> None:
        """Replace a text that stands once in a file."""
        text = (self.folder / path).read_text()
        assert text.count(old) == 1, f"{path}: {old}"
        (self.folder / path).write_text(text.replace(old, new))


def _let_be_interrupted() -> None:
    """A process that was started in the background ignores Ctrl-C, and so do those that it starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def on(profile: str) -> list[str]:
    """Options for a profile, with the tiny capture's own chunks."""
    options = ["--workflow-profile", f"profiles/{profile}", "--config", "chunk_frames=8"]
    asks = ["--slurm-status-command", "sacct"] if WITH_ACCOUNTING and profile == "slurm" else []
    return [*options, *asks]


def files_of(folder: Path) -> dict[str, bytes]:
    """Relative path -> bytes, of every result; what was noted of jobs (logs, seconds, ends) is none."""
    skipped = {"logs", "benchmarks", "seconds.tsv", "checksums.tsv"}
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and not skipped & set(path.relative_to(folder).parts)
        and not path.name.startswith(".snakemake")
    }


def different(found: dict[str, bytes], expected: dict[str, bytes]) -> list[str]:
    """Names of the files that two folders of results do not have alike."""
    return sorted(name for name in {*found, *expected} if found.get(name) != expected.get(name))


def wait_until(holds: Callable[[], bool], what: str, seconds: float = 120) -> None:
    """Wait for something that a test needs."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"no {what} within {seconds:.0f} s"
        time.sleep(0.2)


def kill(process: subprocess.Popen) -> None:
    """End a Snakemake and what it started on this host, but none of its Slurm jobs, as a power cut does."""
    for child in psutil.Process(process.pid).children(recursive=True):
        child.kill()
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=60)
