"""`python -m benchmarks` lists what can be measured; `python -m benchmarks NAME ...` measures it."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from vermilion.app.subcommands import listing, parser_of, subcommands


@cache
def benchmarks() -> dict[str, str]:
    """Name of each benchmark -> the first line of its docstring."""
    return subcommands(Path(__file__).parent)


def usage() -> str:
    """How to call it, and one line a benchmark."""
    line = "usage: python -m benchmarks NAME [--help] [options], from the repository's root"
    return listing(line, benchmarks())


def main(arguments: Sequence[str] | None = None) -> int:
    """List the benchmarks, or run one; returns the exit status."""
    name, *options = [*(sys.argv[1:] if arguments is None else arguments)] or ["--help"]
    if name in ("-h", "--help"):
        print(usage())
        return 0
    if name not in benchmarks():
        print(f"no benchmark is called {name!r}\n\n{usage()}", file=sys.stderr)
        return 2
    # Figures are of one core. This takes effect only before numpy loads.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    parsed = parser_of(f"benchmarks.{name}", f"python -m benchmarks {name}").parse_args(options)

    import cv2

    from vermilion.storage.errors import VermilionError

    cv2.setNumThreads(1)
    try:
        parsed.run(parsed)
    except VermilionError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
