"""A job that ends when the run that started it is killed.

The job would go on alone otherwise, and write its results beside the same job of the next run.
"""

from __future__ import annotations

import os
import select
import signal
import threading
from pathlib import Path

#: Environment variable: process number of the Snakemake that starts a job.
RUN = "VERMILION_RUN_PID"


def end_with_run() -> None:
    """End this process as soon as the Snakemake that started it has ended, or a shell between them.

    Only on Linux, and only for jobs that Snakemake starts.
    """
    run = os.environ.get(RUN, "")
    if not run.isdigit() or not hasattr(os, "pidfd_open") or not Path("/proc/self/stat").exists():
        return
    chain = _ancestors(int(run))
    handles = []
    try:
        handles = [os.pidfd_open(pid) for pid in chain]
    except ProcessLookupError:
        chain = []
    except OSError:
        return  # a kernel without it
    if not chain or _ancestors(int(run)) != chain:
        _end()  # it was killed before this job could look
    threading.Thread(target=_wait_for_one_of, args=(handles,), daemon=True).start()


def _wait_for_one_of(handles: list[int]) -> None:
    """Wait until one of some processes has ended; then end."""
    waiting = select.poll()
    for handle in handles:
        waiting.register(handle, select.POLLIN)
    waiting.poll()
    _end()


def _end() -> None:
    """End at once: nobody is there to be told."""
    os.kill(os.getpid(), signal.SIGKILL)


def _ancestors(last: int) -> list[int]:
    """This process's parent, its parent, and so on up to `last`; empty where `last` is none of them."""
    chain, pid = [], os.getppid()
    while pid > 1:
        chain.append(pid)
        if pid == last:
            return chain
        try:
            stat = Path(f"/proc/{pid}/stat").read_text()
        except OSError:
            return []
        pid = int(stat.rpartition(")")[2].split()[1])
    return []
