"""Slurm jobs that outlived the Snakemake that had submitted them.

A Snakemake that is killed leaves its jobs in the queue. The next run submits the same work again; a late
job of the first would then write what the second has written already, perhaps with other code.
"""

from __future__ import annotations

import getpass
import hashlib
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from vermilion.storage.errors import InputError

_FORMAT = "%i|%j|%k"  # number, name, comment
_ENDED_WITHIN_S = 120.0


def name_for(results: str | Path) -> str:
    """What the names (Slurm plugin) or comments (plain sbatch) of all jobs of these results begin with."""
    return "vermilion-" + hashlib.sha256(str(Path(results).resolve()).encode()).hexdigest()[:12]


def jobs_of_run(name: str) -> list[str]:
    """Numbers of this user's pending and running jobs whose name or comment begins with `name`."""
    listing = subprocess.run(
        ["squeue", "--noheader", "--user", getpass.getuser(), "--format", _FORMAT],
        capture_output=True,
        text=True,
    )
    rows = [line.split("|") for line in listing.stdout.splitlines()]
    return [row[0] for row in rows if any(cell.startswith(name) for cell in row[1:])]


def cancel_jobs(numbers: Sequence[str], within_s: float = _ENDED_WITHIN_S) -> None:
    """Cancel jobs and wait until the last of them has ended.

    Raises:
        InputError: some are still there after `within_s` seconds.
    """
    subprocess.run(["scancel", *numbers], capture_output=True)
    end = time.monotonic() + within_s
    while left := _alive(numbers):
        if time.monotonic() > end:
            raise InputError(
                f"Slurm jobs {', '.join(left)} of an earlier run that go on after scancel",
                "none that writes into the same results",
                "Wait until they have ended (squeue), then run the same command again.",
            )
        time.sleep(0.5)


def _alive(numbers: Sequence[str]) -> list[str]:
    """Those of some jobs that have not ended, with what Slurm still shows of ended ones left out."""
    listing = subprocess.run(
        ["squeue", "--noheader", "--states", "PD,R,CF,CG,S", "--format", "%i"],
        capture_output=True,
        text=True,
    )
    return [number for number in numbers if number in listing.stdout.split()]
