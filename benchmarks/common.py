"""Arguments, timing and tables of the benchmarks."""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd


def add_run_arguments(
    parser: argparse.ArgumentParser,
    take: str = "p1/phone",
    *,
    required: bool = True,
    truth: bool = True,
) -> None:
    """`--results`, `--take`, `--capture` and, with `truth`, `--truth`: see `finished_run`."""
    parser.add_argument(
        "--results", type=Path, required=required, metavar="FOLDER", help="folder of a finished run"
    )
    parser.add_argument(
        "--take", default=take, metavar="SUBJECT/TAKE", help="take of that run (%(default)s)"
    )
    whose = "that holds SUBJECT/TAKE, or the take's own"
    parser.add_argument(
        "--capture",
        type=Path,
        metavar="FOLDER",
        help=f"folder of captures {whose}; default: captures of the results",
    )
    if truth:
        parser.add_argument(
            "--truth",
            type=Path,
            metavar="FOLDER",
            help=f"folder of true meshes {whose}; default: truth of the results",
        )


def add_data_argument(parser: argparse.ArgumentParser) -> None:
    """`--data`, the folder of optional data."""
    parser.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        default=Path(os.environ.get("VERMILION_DATA", "../shared/data")),
        help="folder of optional data (VERMILION_DATA, else ../shared/data)",
    )


@dataclass(frozen=True)
class Timed:
    """What a task returned, its seconds of wall clock, and its seconds of processor time."""

    result: Any
    wall_s: float
    cpu_s: float


def timed(task: Callable[[], Any], *, rounds: int = 1, warm_up: bool = False) -> Timed:
    """Run a task: its last result and the least seconds of the rounds, as other load only adds.

    Args:
        task: what is measured.
        rounds: how often it runs.
        warm_up: run it once before, so that what is compiled or read once does not count.
    """
    if warm_up:
        task()
    walls, cpus = [], []
    for _ in range(rounds):
        wall, cpu = time.perf_counter(), time.process_time()
        result = task()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return Timed(result, min(walls), min(cpus))


def peak_gb() -> float:
    """The largest memory that this process has used."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def print_table(
    rows: Sequence[Mapping[str, Any]] | pd.DataFrame, digits: int | Mapping[str, int] = 2
) -> None:
    """Print rows as a table; what a row does not have stays empty.

    `digits` are those behind the point, of all numbers or by column (2 where a column has none).
    """
    table = pd.DataFrame(rows)
    shown = {}
    for column in table.select_dtypes("floating"):
        places = digits if isinstance(digits, int) else digits.get(column, 2)
        shown[column] = f"{{:.{places}f}}".format
    print(table.to_string(index=False, formatters=shown, na_rep=""), flush=True)
