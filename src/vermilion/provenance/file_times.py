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
    """Where jobs read results from the future, set all such results' times to now; refuse inputs of the user.

    What the files hold is not touched. All get the same time, as Snakemake compares folders by nothing else.

    Args:
        results: the folder of results.
        inputs: files that jobs are about to read; those that do not exist yet are left out.
        now_s: the time, seconds since the epoch.

    Returns:
        the files and folders of the results whose times were set.

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
    return _set_back(results, now_s) if ahead else []


def _set_back(results: Path, now_s: float) -> list[Path]:
    """Give everything in the results that is from the future the time of now."""
    mended = []
    for place, _, files in os.walk(results):
        for path in (Path(place), *(Path(place, name) for name in files)):
            if path.lstat().st_mtime > now_s + _SLACK_S:
                os.utime(path, (now_s, now_s), follow_symlinks=False)
                mended.append(path)
    return sorted(mended)


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
