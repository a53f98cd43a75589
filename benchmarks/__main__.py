"""`python -m benchmarks` lists what can be measured; `python -m benchmarks NAME ...` measures it."""

from __future__ import annotations

import argparse
import ast
import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path


def benchmarks() -> dict[str, str]:
    """Name of each benchmark -> the first line of its docstring.

    A module with a function `run` is a benchmark; the others hold what benchmarks share. Modules are
    parsed, not imported, so that the list is quick.
    """
    found = {}
    for path in sorted(Path(__file__).parent.glob("*.py")):
        tree = ast.parse(path.read_text())
        if any(isinstance(node, ast.FunctionDef) and node.name == "run" for node in tree.body):
            found[path.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    return found


def parser_of(name: str) -> argparse.ArgumentParser:
    """The command line of a benchmark; its help is the module's docstring."""
    module = importlib.import_module(f"benchmarks.{name}")
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks {name}",
        description=module.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    parser.set_defaults(run=module.run)
    return parser


def listing() -> str:
    """One line a benchmark."""
    lines = [f"  {name:14} {line}" for name, line in benchmarks().items()]
    usage = "usage: python -m benchmarks NAME [--help] [options], from the repository's root"
    return "\n".join([usage, "", *lines])


def main(arguments: Sequence[str] | None = None) -> int:
    """List the benchmarks, or run one; returns the exit status."""
    name, *options = [*(sys.argv[1:] if arguments is None else arguments)] or ["--help"]
    if name in ("-h", "--help"):
        print(listing())
        return 0
    if name not in benchmarks():
        print(f"no benchmark is called {name!r}\n\n{listing()}", file=sys.stderr)
        return 2
    # Figures are of one core. This takes effect only before numpy loads.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    parsed = parser_of(name).parse_args(options)

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
