"""The command `vermilion`: one subcommand a module of `vermilion.app.commands`."""

from __future__ import annotations

import argparse
import ast
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

#: Order of the list; further subcommands follow by name.
_FIRST = ("lips", "demo", "run", "sketch", "report", "verify", "doctor", "docs")


def subcommands() -> dict[str, str]:
    """Name of each subcommand -> the first line of its docstring. Modules are parsed, not imported."""
    found = {}
    for path in sorted((Path(__file__).parent / "commands").glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "run" for node in tree.body):
            found[path.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    order = [name for name in _FIRST if name in found]
    return {name: found[name] for name in [*order, *sorted(set(found) - set(order))]}


def parser_of(name: str) -> argparse.ArgumentParser:
    """The command line of a subcommand; its help is the module's docstring."""
    module = importlib.import_module(f"vermilion.app.commands.{name}")
    parser = argparse.ArgumentParser(
        prog=f"vermilion {name}",
        description=module.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    parser.set_defaults(run=module.run, passes_on=getattr(module, "PASSES_ON", False))
    return parser


def listing() -> str:
    """One line a subcommand."""
    lines = [f"  {name:10} {line}" for name, line in subcommands().items()]
    usage = "usage: vermilion COMMAND [--help] [options], from the project's folder"
    return "\n".join([usage, "", *lines])


def main(arguments: Sequence[str] | None = None) -> int:
    """List the subcommands, or run one; returns the exit status."""
    name, *options = [*(sys.argv[1:] if arguments is None else arguments)] or ["--help"]
    if name in ("-h", "--help"):
        print(listing())
        return 0
    if name == "--version":
        import vermilion

        print(f"vermilion {vermilion.__version__}")
        return 0
    if name not in subcommands():
        print(f"no subcommand is called {name!r}\n\n{listing()}", file=sys.stderr)
        return 2
    parser = parser_of(name)
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
