"""Propagate: the workflow's own jobs, started beside the page, watched and cancelled."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

from vermilion.app.sketch.refusal import RefusedRequest
from vermilion.app.snakemake_command import snakemake_command
from vermilion.storage.errors import VermilionError

_STEPS = re.compile(r"^(\d+) of (\d+) steps \(\d+%\) done")
_RULE = re.compile(r"^(?:local)?(?:rule|checkpoint) (\w+):")
_FAILED = re.compile(r"^Error in rule (\w+):")
_LOG = re.compile(r"^\s+log: (\S+)")
_KEPT_LINES = 400
_LOG_LINES = 40
#: How long a run may take to stop its jobs before it is ended (s).
_PATIENCE_S = 10.0


class PropagationRun:
    """At most one run of the workflow at a time.

    States: `idle`, `counting`, `running`, `cancelling`, `done`, `failed`, `cancelled`.
    """

    def __init__(self, configuration: str, targets: list[str], options: list[str]):
        """`options` of Snakemake, such as the number of cores."""
        self._words = snakemake_command(configuration, options)
        self._targets = targets
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._lines: deque[str] = deque(maxlen=_KEPT_LINES)
        self._state, self._sentence = "idle", ""
        self._done = self._total = 0
        self._rule, self._failed_rule, self._failed_log = "", "", ""
        self._start = self._last_end = self._end = 0.0

    def jobs(self) -> dict[str, int]:
        """Rule -> number of jobs that a run would start. Raises VermilionError where it cannot be told."""
        made = subprocess.run(
            [*self._words, "--dry-run", "--quiet", "host", "reason", "--", *self._targets],
            capture_output=True, text=True, check=False, env=_environment(),
        )  # fmt: skip
        printed = made.stdout + made.stderr
        if made.returncode:
            raise VermilionError(f"The workflow cannot be planned: {_last_words(printed)}")
        return jobs_of(printed)

    def start(self) -> None:
        """Start the run. Raises RefusedRequest (409) where one is under way."""
        with self._lock:
            if self._state in ("running", "cancelling"):
                raise RefusedRequest(409, "A propagation is running; wait for it, or cancel it.")
            self._lines.clear()
            self._done = self._total = 0
            self._rule = self._failed_rule = self._failed_log = self._sentence = ""
            self._start, self._end, self._state = time.time(), 0.0, "running"
            self._process = subprocess.Popen(
                [*self._words, "--", *self._targets],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                start_new_session=True, env=_environment(),
            )  # fmt: skip
            process = self._process
        threading.Thread(target=self._watch, args=(process,), daemon=True).start()

    def cancel(self) -> None:
        """Ask the run to stop; its finished jobs stay. Nothing happens where none is running."""
        with self._lock:
            if self._state != "running" or self._process is None:
                return
            self._state = "cancelling"
            process = self._process
        threading.Thread(target=_stop, args=(process,), daemon=True).start()

    def close(self) -> None:
        """Stop the run, as the server ends."""
        process = self._process
        if process is not None and process.poll() is None:
            _stop(process)

    def report(self) -> dict[str, Any]:
        """State, jobs done and in all, the rule at work, time taken and left, and what went wrong."""
        with self._lock:
            taken = (self._end or time.time()) - self._start if self._start else 0.0
            left = None
            if self._state == "running" and self._done and self._total:
                # As long a job as those that ended; what the present one has taken is over.
                job = (self._last_end - self._start) / self._done
                since = time.time() - self._last_end
                left = max(job * (self._total - self._done) - since, 0.0)
            return {
                "state": self._state, "done": self._done, "total": self._total,
                "rule": self._rule, "taken_s": taken, "left_s": left,
                "sentence": self._sentence, "started": self._start,
            }  # fmt: skip

    def log(self) -> str:
        """The log of the job that failed, else the last lines of the run."""
        with self._lock:
            lines, path = list(self._lines), self._failed_log
        if path and Path(path).is_file():
            text = Path(path).read_text(encoding="utf-8", errors="replace")
            return f"{path}\n\n" + "\n".join(text.splitlines()[-_LOG_LINES:])
        return "\n".join(lines[-_LOG_LINES:])

    def _watch(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            with self._lock:
                self._take_in(line.rstrip("\n"))
        code = process.wait()
        with self._lock:
            self._end = time.time()
            if self._state == "cancelling":
                self._state = "cancelled"
                self._sentence = "Cancelled; the jobs that had ended are kept."
            elif code:
                self._state, self._sentence = "failed", self._failure()
            else:
                self._state = "done"
                self._sentence = "" if self._total else "Nothing had changed since the last run."

    def _take_in(self, line: str) -> None:
        self._lines.append(line)
        if found := _STEPS.match(line):
            self._done, self._total = int(found[1]), int(found[2])
            self._last_end = time.time()
        elif found := re.match(r"^total\s+(\d+)", line):
            self._total = int(found[1])
        elif found := _RULE.match(line):
            self._rule = found[1]
        elif found := _FAILED.match(line):
            self._failed_rule = self._failed_rule or found[1]
        elif self._failed_rule and not self._failed_log and (found := _LOG.match(line)):
            self._failed_log = found[1]

    def _failure(self) -> str:
        printed = "\n".join(self._lines)
        held = [line.strip() for line in self._lines if "another run at work in it" in line]
        if held:
            return held[0]
        if "LockException" in printed or "cannot be locked" in printed:
            return (
                "Another run of the workflow works on these results. Wait until it has ended; if "
                "none is running, `snakemake --unlock` frees the folder."
            )
        if self._failed_rule:
            return f"The job {self._failed_rule} failed; its log is below."
        return f"The workflow failed: {_last_words(printed)}"


def jobs_of(printed: str) -> dict[str, int]:
    """Rule -> jobs of the table that a dry run printed."""
    if "Job stats:" not in printed:
        return {}
    table = printed.split("Job stats:")[1].split("\ntotal")[0]
    return {rule: int(n) for rule, n in re.findall(r"^(\w+)\s+(\d+)$", table, re.MULTILINE)}


def _last_words(printed: str) -> str:
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    return " ".join(lines[-3:])[-600:] or "it printed nothing"


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONUNBUFFERED": "1", "NO_COLOR": "1"}


def _stop(process: subprocess.Popen[str]) -> None:
    """End a run's whole process group, gently first: Snakemake then removes unfinished outputs."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
            process.wait(_PATIENCE_S)
            return
        except ProcessLookupError:
            return
        except subprocess.TimeoutExpired:
            continue
