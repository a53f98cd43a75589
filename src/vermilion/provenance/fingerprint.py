"""A fingerprint of the code that a script runs: itself and the modules it imports.

Comments, docstrings and formatting do not change it; any other change to the script, or to a module
of the package that it imports directly or through others, does.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

PACKAGE = "vermilion"
SOURCE = Path(__file__).resolve().parents[1]


@cache
def fingerprint(script: Path, source: Path = SOURCE) -> str:
    """Hexadecimal digest of `script` and, transitively, of what it imports from the package.

    Args:
        script: a Python file.
        source: folder of the package `vermilion`.
    """
    closure = sorted(imported_files(script, source))
    digest = hashlib.sha256(_tree_text(script).encode())
    for path in closure:
        digest.update(f"\n{path.relative_to(source)}\n{_tree_text(path)}".encode())
    return digest.hexdigest()[:16]


def imported_files(script: Path, source: Path = SOURCE) -> set[Path]:
    """Files of the package that `script` imports, transitively, wherever the import stands."""
    found: set[Path] = set()
    pending = [script]
    while pending:
        for path in _direct_imports(pending.pop(), source):
            if path not in found:
                found.add(path)
                pending.append(path)
    return found


@cache
def _tree(path: Path) -> ast.Module:
    """The syntax tree without docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Module | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
            and ast.get_docstring(node, clean=False) is not None
        ):
            node.body = node.body[1:] or [ast.Pass()]
    return tree


@cache
def _tree_text(path: Path) -> str:
    return ast.dump(_tree(path))


@cache
def _direct_imports(path: Path, source: Path) -> tuple[Path, ...]:
    names: set[str] = set()
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, path, source)
            names.add(base)
            names.update(f"{base}.{alias.name}" for alias in node.names)
    files = {file for name in names for file in _files_of(name, source)}
    return tuple(sorted(files))


def _absolute(node: ast.ImportFrom, path: Path, source: Path) -> str:
    if node.level == 0:
        return node.module or ""
    parts = [PACKAGE, *path.relative_to(source).with_suffix("").parts]
    parent = parts[: len(parts) - node.level]
    return ".".join([*parent, *([node.module] if node.module else [])])


def _files_of(name: str, source: Path) -> list[Path]:
    """The module's file and the `__init__.py` of each package on the way to it."""
    parts = name.split(".")
    if parts[0] != PACKAGE:
        return []
    files = []
    folder = source
    for part in parts[1:]:
        if (folder / "__init__.py").is_file():
            files.append(folder / "__init__.py")
        if (folder / f"{part}.py").is_file():
            files.append(folder / f"{part}.py")
            return files
        folder = folder / part
    if (folder / "__init__.py").is_file():
        files.append(folder / "__init__.py")
    return files
