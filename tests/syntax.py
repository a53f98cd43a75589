"""The project's own source files, read and parsed once a process for all tests that look at them."""

from __future__ import annotations

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@cache
def tree_of(path: Path) -> ast.Module:
    """No test may change it."""
    was_on = gc.isenabled()
    gc.disable()  # a tree is many objects and no garbage: looking through them takes as long again
    try:
        return ast.parse(text_of(path))
    finally:
        if was_on:
            gc.enable()


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of a file's tree, breadth first."""
    return tuple(ast.walk(tree_of(path)))
