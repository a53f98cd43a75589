"""How far a run of the workflow is, from what Snakemake prints and what its jobs log.

    [ 7/19] image_fit: 48 of 100 frames, 3.1 a second; about 2 min left

Snakemake says which jobs there are, start and end; `storage.progress` writes into the log of a job how
many of its frames are done.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

_JOB = re.compile(r"^(?:local)?(?:rule|checkpoint) (\w+):$")
_FIELD = re.compile(r"^    (\w+): (.*)$")
_COUNT = re.compile(r"^(\w+) +(\d+)$")
_FINISHED = re.compile(r"^Finished jobid: (\d+)")
_STEPS = re.compile(r"^(\d+) of (\d+) steps ")
_FAILED = re.compile(r"^Error in rule (\w+):$")
#: What `storage.progress` writes.
_FRAMES = re.compile(r"^.*: (\d+) of (\d+), ([\d.]+) a second, (\d+) s left$", re.MULTILINE)
#: Bytes at the end of a log in which the last line of progress is looked for.
_TAIL = 2000


@dataclass
class Job:
    """A job that Snakemake started: its rule, its log file, when it started (seconds)."""

    rule: str
    started_s: float
    log: Path | None = None


@dataclass
class RunProgress:
    """What is known of a run; `feed` it the lines that Snakemake prints.

    Attributes:
        expected_s: rule -> seconds that one of its jobs takes about, as long as none has ended.
        cores: jobs that run side by side.
        said: log of a job -> why it failed, as it said it on the terminal.
    """

    expected_s: Callable[[str], float] = lambda rule: 3.0
    cores: int = 1
    total: int = 0
    done: int = 0
    jobs: dict[str, int] = field(default_factory=dict)
    running: dict[str, Job] = field(default_factory=dict)
    failed: list[Job] = field(default_factory=list)
    said: dict[Path, str] = field(default_factory=dict)
    _paragraph: list[str] = field(default_factory=list)
    _ended: dict[str, list[float]] = field(default_factory=dict)
    _open: Job | None = None
    _counting: bool = False
    _is_failure: bool = False

    def feed(self, line: str, now_s: float) -> None:
        """Take note of a line that Snakemake printed at a time."""
        line = line.rstrip("\n")
        self._listen(line)
        if line == "Job stats:":
            self._counting, self.jobs = True, {}
        elif self._counting and not line:
            self._counting = False
        elif self._counting and (found := _COUNT.match(line)):
            self._count(found[1], int(found[2]))
        elif found := _JOB.match(line):
            self._open, self._is_failure = Job(found[1], now_s), False
        elif found := _FAILED.match(line):
            self._open, self._is_failure = Job(found[1], now_s), True
        elif self._open is not None and (found := _FIELD.match(line)):
            self._note(found[1], found[2])
        elif found := _FINISHED.match(line):
            self._finish(found[1], now_s)
        elif found := _STEPS.match(line):
            self.done, self.total = int(found[1]), int(found[2])

    def _listen(self, line: str) -> None:
        """Keep what a failed job says before it names its log (`storage.logfile`)."""
        if line.startswith("Log: "):
            self.said[Path(line.removeprefix("Log: "))] = "\n".join(self._paragraph)
        self._paragraph = [*self._paragraph, line][-20:] if line else []

    def line(self, now_s: float) -> str:
        """One line for the terminal."""
        if not self.total:
            return "looking for what is to be done"
        head = f"[{self.done:>{len(str(self.total))}}/{self.total}]"
        left = _duration(self.left_s(now_s))
        if not self.running:
            return f"{head} {left} left" if self.done < self.total else f"{head} done"
        job = min(self.running.values(), key=lambda job: job.started_s)
        others = f" (and {len(self.running) - 1} more)" if len(self.running) > 1 else ""
        frames = _frames_of(job)
        rate = (
            ""
            if frames is None
            else f": {frames[0]} of {frames[1]} frames, {frames[2]:.3g} a second"
        )
        return f"{head} {job.rule}{rate}{others}; about {left} left"

    def left_s(self, now_s: float) -> float:
        """Seconds until the end of the run: of what runs, of what has not started, over the cores."""
        waiting = dict(self.jobs)
        left = 0.0
        for job in self.running.values():
            waiting[job.rule] = waiting.get(job.rule, 1) - 1
            frames = _frames_of(job)
            rest = self._typical_s(job.rule) - (now_s - job.started_s)
            left += max(rest, 0.0) if frames is None else frames[3]
        left += sum(max(count, 0) * self._typical_s(rule) for rule, count in waiting.items())
        return left / max(self.cores, 1)

    def _typical_s(self, rule: str) -> float:
        """Seconds of a job: the mean of those that ended, else what is expected."""
        ended = self._ended.get(rule)
        if ended:
            return sum(ended) / len(ended)
        return self.expected_s(rule) * self._pace()

    def _pace(self) -> float:
        """How much longer jobs take here than expected, by those that ended."""
        expected = sum(self.expected_s(rule) * len(times) for rule, times in self._ended.items())
        actual = sum(sum(times) for times in self._ended.values())
        return actual / expected if expected > 0 and actual > 0 else 1.0

    def _count(self, rule: str, count: int) -> None:
        if rule == "total":
            self.total = count
        else:
            self.jobs[rule] = count

    def _note(self, name: str, value: str) -> None:
        assert self._open is not None
        if name == "log":
            self._open.log = Path(value.partition(" (check log")[0].partition(", ")[0])
            if self._is_failure:
                self.failed.append(self._open)
        elif name == "jobid" and not self._is_failure:
            self.running[value] = self._open
        elif name == "jobid":
            self.running.pop(value, None)

    def _finish(self, jobid: str, now_s: float) -> None:
        job = self.running.pop(jobid, None)
        if job is None:
            return
        self._ended.setdefault(job.rule, []).append(now_s - job.started_s)
        self.jobs[job.rule] = self.jobs.get(job.rule, 1) - 1


def _frames_of(job: Job) -> tuple[int, int, float, float] | None:
    """(done, all, a second, seconds left) by the last line of progress in a job's log."""
    if job.log is None:
        return None
    try:
        with open(job.log, "rb") as stream:
            stream.seek(0, 2)
            stream.seek(max(stream.tell() - _TAIL, 0))
            text = stream.read().decode("utf-8", errors="replace")
    except OSError:
        return None
    lines = _FRAMES.findall(text)
    if not lines:
        return None
    done, count, rate, left = lines[-1]
    return int(done), int(count), float(rate), float(left)


def _duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5):.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
