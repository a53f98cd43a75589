"""Run Snakemake as a process beside, with one line of progress on the terminal."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import IO

from vermilion.app.run_progress import RunProgress
from vermilion.storage.logfile import FAILED_SUFFIX
from vermilion.storage.unwritable import explain, full_disk

#: Options with which Snakemake tells something instead of running jobs.
TELLING = frozenset(
    ("-n", "--dry-run", "--dryrun", "--unlock", "--lint", "--list", "--summary", "--dag")
)
_EVERY_S = 1.0
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
#: Lines of what Snakemake printed last, to say what failed before any job.
_LAST_LINES = 1000
#: How Snakemake begins to tell what a rule file raised.
_RAISED = re.compile(r'(?:WorkflowError|InputFunctionException) in .*file ".*\.smk", line \d+:')
#: Without a terminal, a line is printed where the stage changes, and this often.
_PLAIN_EVERY_S = 20.0


class ProgressLine:
    """The one line: overwritten on a terminal, printed now and then elsewhere."""

    def __init__(self, stream: IO[str]):
        self._stream, self._last, self._printed_s = stream, "", float("-inf")
        self._overwrites = stream.isatty()

    def show(self, text: str, now_s: float) -> None:
        """Show a new state of the line."""
        if self._overwrites:
            width = shutil.get_terminal_size().columns - 1
            self._stream.write(f"\r\033[K{text[:width]}")
        else:
            stage = text.partition(":")[0].partition(";")[0].partition("] ")[2]
            if stage == self._last and now_s - self._printed_s < _PLAIN_EVERY_S:
                return
            self._last, self._printed_s = stage, now_s
            self._stream.write(f"{text}\n")
        self._stream.flush()

    def clear(self) -> None:
        """Leave the terminal as if the line had never been there."""
        if self._overwrites:
            self._stream.write("\r\033[K")
            self._stream.flush()


def run_workflow(
    words: Sequence[str],
    log: Path,
    expected_s: Callable[[str], float] | None = None,
    stream: IO[str] | None = None,
) -> int:
    """Run a command of Snakemake; what it prints goes to `log`, the line of progress to the terminal.

    A job that fails is named with its reason and its log file. Where Snakemake fails before any job,
    its own message is printed.

    Args:
        words: the command.
        log: file for all that Snakemake prints.
        expected_s: see `RunProgress`.
        stream: the terminal; standard error where left out.

    Returns:
        exit code of Snakemake.
    """
    if TELLING.intersection(words):
        return subprocess.run(words, check=False).returncode
    stream = sys.stderr if stream is None else stream
    state, started = RunProgress(cores=_cores(words)), time.monotonic()
    if expected_s is not None:
        state.expected_s = expected_s
    code, printed = _follow(words, log, state, ProgressLine(stream))
    if code == 0 and state.total:
        print(f"{state.total} steps in {(time.monotonic() - started) / 60:.1f} min", file=stream)
    elif code:
        print(_failure(state, log, printed), file=stream)
    stream.flush()
    return code


def _follow(
    words: Sequence[str], log: Path, state: RunProgress, shown: ProgressLine
) -> tuple[int, list[str]]:
    """Run the command, keep what it prints, show the line meanwhile; returns its exit code and last lines."""
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        kept: IO[str] | None = open(log, "w", encoding="utf-8")  # noqa: SIM115 - closed below
    except OSError as error:
        raise explain(error, log) from error
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    )
    ended, lock, last = threading.Event(), threading.Lock(), deque[str](maxlen=_LAST_LINES)

    def refresh() -> None:
        while not ended.wait(_EVERY_S):
            now = time.monotonic()
            with lock:
                line = state.line(now)
            shown.show(line, now)

    ticker = threading.Thread(target=refresh, daemon=True)
    ticker.start()
    try:
        assert process.stdout is not None  # a pipe
        with _passed_on(process):
            for line in process.stdout:
                last.append(line)
                kept = _keep(kept, line)
                with lock:
                    state.feed(line, time.monotonic())
            return process.wait(), list(last)
    except KeyboardInterrupt:
        process.wait()  # the terminal has told Snakemake as well
        raise
    finally:
        ended.set()
        ticker.join()
        shown.clear()
        if kept is not None:
            kept.close()


@contextlib.contextmanager
def _passed_on(process: subprocess.Popen[str]) -> Iterator[None]:
    """Pass on what asks this process to end: Snakemake would else go on with nobody to read what it prints.

    A terminal's interrupt reaches both by itself; `kill`, a batch system or a closed session may reach this
    process alone. Snakemake then starts no more jobs, and this process ends with it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals come to the main thread, which is another's
        return

    def pass_on(number: int, _: object) -> None:
        print("\nAsked to end: running jobs are awaited.", file=sys.stderr, flush=True)
        process.send_signal(number)

    before = {n: signal.signal(n, pass_on) for n in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _keep(log: IO[str] | None, line: str) -> IO[str] | None:
    """Add a line to the log; None from when the disk is full: the run and its message go on without."""
    if log is not None:
        try:
            log.write(line)
            log.flush()
        except OSError:
            with contextlib.suppress(OSError):
                log.close()
            return None
    return log


def _failure(state: RunProgress, log: Path, printed: Sequence[str]) -> str:
    """What failed and why, with the log of each job; else the end of what Snakemake said."""
    seen, parts = set(), []
    for job in state.failed:
        if job.log is None or job.log in seen:
            continue
        seen.add(job.log)
        reason = Path(f"{job.log}{FAILED_SUFFIX}")
        why = reason.read_text(encoding="utf-8").strip() if reason.is_file() else ""
        why = why or state.said.get(job.log) or "see its log"  # a full disk keeps no reason
        parts.append(f"{job.rule} failed: {why}\nLog: {job.log}")
    if parts:
        return "\n".join(["", *parts, ""])
    lines = "".join(printed).strip().splitlines()
    if any(os.strerror(number) in line for line in lines for number in _NO_ROOM):
        return f"\n{full_disk(Path('.snakemake').absolute())}\n"  # Snakemake's own files
    said = _said_by_rules(lines)
    if said:
        return "\n".join(["", *said, f"Log: {log}", ""])
    starts = [n for n, line in enumerate(lines) if "Error" in line or "Exception" in line]
    return "\n".join(["", *lines[starts[0] if starts else -12 :][:60], f"Log: {log}", ""])


def _said_by_rules(lines: Sequence[str]) -> list[str]:
    """Lines of what a rule file says is wrong, without where in the file; empty: it says nothing."""
    start = next((n for n, line in enumerate(lines) if _RAISED.fullmatch(line)), None)
    if start is None:
        return []
    said = lines[start + 1 :]
    if lines[start].startswith("Input"):
        if list(said[:2]) != ["Error:", "  WorkflowError:"]:
            return []  # an error in our code: all of it is needed
        said = [line[4:] for line in takewhile(lambda line: line.startswith("    "), said[2:])]
    return list(takewhile(lambda line: not line.startswith('  File "'), said))


def _cores(words: Sequence[str]) -> int:
    """Jobs side by side: what `--cores` says, else all cores of this machine."""
    for option in ("--cores", "-c"):
        if option in words:
            value = words[words.index(option) + 1] if words.index(option) + 1 < len(words) else ""
            if value.isdigit():
                return int(value)
    return os.cpu_count() or 1
