"""Files from the future, as they are when the clock was set back: Snakemake fails every job that reads one."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

from vermilion.storage.errors import InputError

#: No job ends sooner than that after it started.
_SLACK_S = 1.0


def mend_future_times(results: Path, inputs: Iterable[Path], now_s: float) -> list[Path]:
    """Set the times of results that lie in the future to now; refuse inputs of the user that do.

    What the files hold is not touched, and Snakemake compares that before it makes anything again.

    Args:
        results: the folder of results.
        inputs: files that jobs are about to read; those that do not exist yet are left out.
        now_s: the time, seconds since the epoch.

    Returns:
        the results whose times were set.

    Raises:
        InputError: a file of the user is from the future.
    """
    ahead = {path: time for path in inputs if (time := _time_s(path)) > now_s + _SLACK_S}
    given = sorted(path for path in ahead if not path.is_relative_to(results))
    if given:
        latest = given[0]
        others = f", and {len(given) - 1} more" if len(given) > 1 else ""
        raise InputError(
            f"a time in the future, {_clock(ahead[latest])}{others}, where it is {_clock(now_s)}",
            "files that are older than what is made of them",
            "Set the clock right, or `touch` the file: its content is compared, nothing is made again for "
            "its time.",
            path=latest,
        )
    for path in ahead:
        os.utime(_carrier(path), (now_s, now_s))
    return sorted(ahead)


def _carrier(path: Path) -> Path:
    """The file that has the time of an output: of a folder, Snakemake's own file in it."""
    stamp = path / ".snakemake_timestamp"
    return stamp if path.is_dir() and stamp.exists() else path


def _time_s(path: Path) -> float:
    try:
        return _carrier(path).stat().st_mtime
    except OSError:
        return float("-inf")


def _clock(time_s: float) -> str:
    return datetime.fromtimestamp(time_s).astimezone().strftime("%Y-%m-%d %H:%M:%S %Z")
