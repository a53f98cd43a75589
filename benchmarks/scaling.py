"""Strong and weak scaling of computing jobs on the cores of one machine.

The images of a synthetic take are rendered chunk by chunk by the workflow: the same chunks with more cores
(strong), and as many more chunks as cores (weak). Planning is counted. Other work on the machine spoils it.

    python -m benchmarks scaling --frames 60 --chunks 4 --cores 1 2
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from benchmarks.common import print_table
from benchmarks.overhead import make_project, spent


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The size of the take, and the numbers of cores."""
    parser.add_argument("--frames", type=int, default=60, help="frames of a chunk (%(default)s)")
    parser.add_argument(
        "--chunks", type=int, default=4, help="chunks of the take on one core (%(default)s)"
    )
    parser.add_argument(
        "--cores", type=int, nargs="+", default=[1, 2], help="numbers of cores (%(default)s)"
    )
    parser.add_argument("--folder", type=Path, help="to work in (a temporary one)")


def run(arguments: argparse.Namespace) -> None:
    """Time the take with each number of cores, and takes that grow with them."""
    rows = []
    rendered(arguments, 1, 1)  # kernels are compiled once, by whoever comes first
    for cores in arguments.cores:
        strong_s, strong_core_s = rendered(arguments, arguments.chunks, cores)
        weak_s = strong_s if cores == 1 else rendered(arguments, arguments.chunks * cores, cores)[0]
        rows.append(
            {"cores": cores, "strong_s": strong_s, "core_s": strong_core_s, "weak_s": weak_s}
        )
    first = rows[0]  # what the others are compared with
    for row in rows:
        row["times_as_fast"] = first["strong_s"] / row["strong_s"]
        row["weak_efficiency"] = first["weak_s"] / row["weak_s"]
    print_table(rows)


def rendered(arguments: argparse.Namespace, chunks: int, cores: int) -> tuple[float, float]:
    """(Seconds, core seconds) of a take of so many chunks on so many cores."""
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        folder = Path(name)
        make_project(folder, arguments.frames, chunks)
        spent(folder, "--until", "studio_rig_p_video")  # what all of them need, once
        return spent(folder, cores=cores)
