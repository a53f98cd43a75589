"""Runs whose jobs, whose Snakemake, or both are killed at random moments, and the same command again."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from tests.workflow.conftest import Project
from vermilion.provenance import checksums
from vermilion.storage.files import remove_result
from vermilion.storage.tables import read_table

#: Not compared: logs, measured times, and the ledger, which has file times.
NOT_COMPARED = ("logs", "benchmarks", checksums.LEDGER)
KINDS = ("job", "snakemake", "both")
#: A job must end so soon after the run that started it.
ORPHANS_END_WITHIN_S = 20.0


@dataclass
class Results:
    """Digests of the files of a folder of results; a file is read again where its size or time changed."""

    folder: Path
    _known: dict[tuple, str] = field(default_factory=dict)

    def digests(self) -> dict[str, str]:
        """Relative path -> SHA-256, of every file that is compared and not hidden."""
        found = {}
        for path in sorted(_below(self.folder)):
            name = path.relative_to(self.folder)
            if name.parts[0] in NOT_COMPARED or name.name == "seconds.tsv":
                continue
            if any(part.startswith(".") for part in name.parts):
                continue
            try:
                if path.is_file():
                    found[name.as_posix()] = self._digest(path)
            except FileNotFoundError:
                continue  # Snakemake removes what it is about to make
        return found

    def hidden(self) -> list[str]:
        """Files and folders that a writer has not given their names, in the way of Vermilion."""
        return [
            path.as_posix()
            for path in _below(self.folder)
            if path.name.startswith(".") and not path.name.startswith(".snakemake")
        ]

    def _digest(self, path: Path) -> str:
        state = path.stat()
        key = (path, state.st_ino, state.st_size, state.st_mtime_ns)
        if key not in self._known:
            self._known[key] = hashlib.sha256(path.read_bytes()).hexdigest()
        return self._known[key]


@dataclass
class DisturbedRun:
    """Parts of a finished run made again and again, by one command for each part, killed by a seeded chance.

    Attributes:
        expected: digests of an undisturbed run.
        options: further words of the command.
        kills: kind -> how often.
        stages: rule -> how often one of its jobs was at work at a kill.
        completed: how many parts were made whole.
    """

    project: Project
    expected: dict[str, str]
    seed: int
    options: tuple[str, ...] = ()
    kills: Counter = field(default_factory=Counter)
    stages: Counter = field(default_factory=Counter)
    completed: int = 0

    def __post_init__(self):
        self.chance = random.Random(self.seed)
        self.results = Results(self.project.results)
        self.printed = self.project.folder / "disturbed.log"
        self.targets: list[str] = []

    def kill(self, count: int, pauses_s: tuple[float, ...] = (4.0, 4.0, 30.0)) -> None:
        """Kill `count` times; after each kill the same command goes on.

        Each time one of `pauses_s` is the longest that is waited, so that long jobs end as well; mostly from
        when a job runs, sometimes from when Snakemake starts.
        """
        run = None
        while self.kills.total() < count:
            if run is None:
                if not self.targets:
                    self._remove_some()
                run = self._start()
                if self.chance.random() < 0.85:
                    self._wait(run, 120.0, until_a_job_runs=True)
            kind = self.chance.choice(KINDS)
            self._wait(run, self.chance.uniform(0, self.chance.choice(pauses_s)))
            if run.poll() is not None:
                self._ended(run)
                run = None
                continue
            if self._kill(run, kind):
                self.kills[kind] += 1
                print(f"{self.kills.total()}: {kind}", flush=True)
            self.check_whole()
            if run.poll() is not None:
                run = None
        if run is not None:
            run.wait(timeout=1800)
            self.check_whole()

    def complete(self) -> None:
        """What the last command was to make."""
        while self.targets:
            run = self._start()
            run.wait(timeout=1800)
            assert run.returncode == 0, self._tail()
            self._ended(run)

    def finish(self) -> None:
        """Everything: nothing is missing, nothing is left over or to be done, and no checksum differs."""
        self.complete()
        run = self._start()
        run.wait(timeout=3000)
        assert run.returncode == 0, self._tail()
        self._ended(run)
        assert self.project.would_run(*self.options) == {}
        assert checksums.find_damage(self.project.results) == []

    def check_whole(self) -> None:
        """Whatever has its final name is whole, whenever it is looked at."""
        found = self.results.digests()
        half = [name for name, digest in found.items() if digest != self.expected.get(name)]
        assert not half, f"after {dict(self.kills)}, seed {self.seed}: not whole: {half}"

    def _start(self) -> subprocess.Popen:
        """The command, in a process group of its own."""
        with open(self.printed, "a") as log:
            return subprocess.Popen(
                self.project.command(*self.options, *self.targets),
                cwd=self.project.folder,
                env=self.project.environment(),
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _kill(self, run: subprocess.Popen, kind: str) -> bool:
        """Kill a job, Snakemake, or all; False where no job runs that could be killed."""
        family = _descendants(run.pid)
        jobs = [process for process in family if _is_job(process)]
        if kind == "job" and not jobs:
            return False
        self.stages.update([_stage(process) for process in jobs] or ["Snakemake alone"])
        if kind == "job":
            self.chance.choice(jobs).kill()
            return True
        if kind == "both":
            os.killpg(run.pid, signal.SIGKILL)
        else:
            run.kill()
        run.wait(timeout=60)
        _, left = psutil.wait_procs(family, timeout=ORPHANS_END_WITHIN_S)
        assert not left, f"outlived its run: {left}"
        return True

    def _ended(self, run: subprocess.Popen) -> None:
        """A run ended by itself: with all that it was to make, or because a job was killed."""
        self.check_whole()
        if run.returncode:
            assert self.kills["job"], self._tail()
            return
        # A command for a part does not miss what a kill took from before it, where what follows is there.
        wanted = self.targets or [str(self.project.results / name) for name in self.expected]
        assert [name for name in wanted if not (self.project.folder / name).exists()] == []
        assert self.results.hidden() == []
        if self.completed % 5 == 0:
            assert self.project.would_run(*self.options, *self.targets) == {}
        self.completed += 1
        self.targets = []
        print(f"{self.completed} parts whole", flush=True)

    def _remove_some(self) -> None:
        """Take away what some jobs made; the command makes these again."""
        ledger = read_table(self.project.results / checksums.LEDGER)
        jobs = self.chance.sample(sorted(set(ledger["job"])), self.chance.randint(1, 3))
        for job in jobs:
            for output in set(ledger["output"][ledger["job"] == job]):
                remove_result(self.project.results / output)
        place = self.project.results.relative_to(self.project.folder)
        self.targets = [str(place / job) for job in jobs]

    def _wait(self, run: subprocess.Popen, seconds: float, until_a_job_runs: bool = False) -> None:
        end = time.monotonic() + seconds
        while run.poll() is None and time.monotonic() < end:
            time.sleep(min(0.1, max(end - time.monotonic(), 0)))
            if until_a_job_runs and any(_is_job(process) for process in _descendants(run.pid)):
                return

    def _tail(self) -> str:
        return self.printed.read_text(errors="replace")[-4000:]


def _below(folder: Path) -> Iterator[Path]:
    """All files and folders below a folder, also where some vanish meanwhile (`rglob` ends then)."""
    for place, folders, files in os.walk(folder):
        yield from (Path(place) / name for name in (*folders, *files))


def _descendants(pid: int) -> list[psutil.Process]:
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def _stage(process: psutil.Process) -> str:
    """The rule of a job, by the name of its script."""
    try:
        scripts = [part for part in process.cmdline() if ".snakemake/scripts" in part]
        return Path(scripts[0]).name.split(".")[1]
    except (psutil.NoSuchProcess, IndexError):
        return "ending"


def _is_job(process: psutil.Process) -> bool:
    try:
        return "python" in process.name() and any(
            ".snakemake/scripts" in part for part in process.cmdline()
        )
    except psutil.NoSuchProcess:
        return False
