"""The command `vermilion`: one subcommand a module of `vermilion.app.commands`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from vermilion.app.subcommands import listing, parser_of, subcommands

#: Order of the list; further subcommands follow by name.
_FIRST = ("lips", "demo", "run", "sketch", "report", "verify", "generic", "doctor", "docs")


def commands() -> dict[str, str]:
    """Name of each subcommand -> the first line of its docstring."""
    found = subcommands(Path(__file__).parent / "commands", _FIRST)
    return {name.replace("_", "-"): line for name, line in found.items()}


def usage() -> str:
    """How to call it, and one line a subcommand."""
    line = "usage: vermilion COMMAND [--help] [options], from the project's folder"
    return listing(line, commands())


def main(arguments: Sequence[str] | None = None) -> int:
    """List the subcommands, or run one; returns the exit status."""
    name, *options = [*(sys.argv[1:] if arguments is None else arguments)] or ["--help"]
    if name in ("-h", "--help"):
        print(usage())
        return 0
    if name == "--version":
        import vermilion

        print(f"vermilion {vermilion.__version__}")
        return 0
    if name not in commands():
        print(f"no subcommand is called {name!r}\n\n{usage()}", file=sys.stderr)
        return 2
    module = name.replace("-", "_")
    parser = parser_of(f"vermilion.app.commands.{module}", f"vermilion {name}")
    parsed, unknown = parser.parse_known_args(options)
    parsed.options = unknown
    if parsed.options and not parsed.passes_on:
        parser.error(f"unrecognized arguments: {' '.join(parsed.options)}")

    from vermilion.storage.errors import VermilionError

    try:
        return int(parsed.run(parsed) or 0)
    except VermilionError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
