"""Commands of which each is a module with `add_arguments(parser)` and `run(arguments)`.

Modules are parsed, not imported, so that the list is quick.
"""

from __future__ import annotations

import argparse
import ast
import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path


def subcommands(folder: Path, first: Sequence[str] = ()) -> dict[str, str]:
    """Name of each module of a folder with a function `run` -> the first line of its docstring.

    Args:
        folder: of the modules; those without `run` hold what the others share.
        first: names that stand first in the list; the others follow by name.
    """
    found = {}
    for path in sorted(folder.glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "run" for node in tree.body):
            found[path.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    order = [name for name in first if name in found]
    return {name: found[name] for name in [*order, *sorted(set(found) - set(order))]}


def parser_of(module_name: str, program: str) -> argparse.ArgumentParser:
    """The command line of a module; its help is the module's docstring."""
    module = importlib.import_module(module_name)
    parser = argparse.ArgumentParser(
        prog=program,
        description=module.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    parser.set_defaults(run=module.run, passes_on=getattr(module, "PASSES_ON", False))
    return parser


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """The argument of commands that look at a run: its configuration, the demo's by default."""
    parser.add_argument(
        "configuration", nargs="?", default="config/config.yaml", help="a YAML file (the demo's)"
    )


def listing(usage: str, found: Mapping[str, str]) -> str:
    """The usage, and a line for each command."""
    width = max(map(len, found), default=0)
    return "\n".join([usage, "", *(f"  {name:{width}} {line}" for name, line in found.items())])
