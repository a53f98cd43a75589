"""Peak memory of the heavy cases, each made and read in this process: `python -m tests.faults.memory`.

Prints a line a case: bytes, seconds, name. Linux: the peak is reset before each.
"""

from __future__ import annotations

import importlib
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.faults.case import Case, peak_bytes, refusal_of, reset_peak

MODULES = (
    *("images", "videos", "cameras", "meshes", "tables", "archives", "labels"),
    "configurations",
)
#: More address space than libraries ask for, less than harms a machine.
ADDRESSES = 8 << 30


def cases(name: str) -> list[Case]:
    """The cases of a module of this folder."""
    return importlib.import_module(f"tests.faults.test_{name}").CASES


def main() -> None:
    """Measure every heavy case."""
    found = [case for name in MODULES for case in cases(name) if case.heavy]
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    for case in found:
        with tempfile.TemporaryDirectory() as folder:
            path = case.make(Path(folder), np.random.default_rng(case.seed))
            reset_peak()
            start = time.process_time()
            refusal_of(case, path)
            print(f"{peak_bytes()}\t{time.process_time() - start:.3f}\t{case.name}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
