"""A fingerprint of the code that a script runs: itself and the modules it imports.

Comments, docstrings and formatting do not change it; any other change to the script, or to a module
of the package that it imports directly or through others, does.
"""

from __future__ import annotations

import ast
import gc
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import NamedTuple

from vermilion.provenance.known_code import known_code

PACKAGE = "vermilion"
SOURCE = Path(__file__).resolve().parents[1]
#: What was found before this file changed does not count.
_HOW = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


@cache
def fingerprint(script: Path, source: Path = SOURCE) -> str:
    """Hexadecimal digest of `script` and, transitively, of what it imports from the package.

    Args:
        script: a Python file.
        source: folder of the package `vermilion`.
    """
    closure = sorted(imported_files(script, source))
    digest = hashlib.sha256(_read(script, source).digest.encode())
    for path in closure:
        digest.update(f"\n{path.relative_to(source)}\n{_read(path, source).digest}".encode())
    return digest.hexdigest()[:16]


def imported_files(script: Path, source: Path = SOURCE) -> set[Path]:
    """Files of the package that `script` imports, transitively, wherever the import stands."""
    found: set[Path] = set()
    pending = [script]
    while pending:
        for path in _read(pending.pop(), source).imports:
            if path not in found:
                found.add(path)
                pending.append(path)
    return found


class _Code(NamedTuple):
    """What counts of a file: a digest of its syntax tree without docstrings, and what it imports."""

    digest: str
    imports: tuple[Path, ...]


@cache
def _read(path: Path, source: Path) -> _Code:
    content = path.read_bytes()
    # Relative imports depend on where the file stands.
    place = path.relative_to(source) if path.is_relative_to(source) else ""
    key = hashlib.sha256(f"{_HOW}\n{place}\n".encode() + content).hexdigest()
    found = known_code().get(key)
    if found is None:
        found = _parsed(content, path, source)
        known_code().add(key, *found)
    digest, names = found
    files = {file for name in names for file in _files_of(name, source)}
    return _Code(digest, tuple(sorted(files)))


def _parsed(content: bytes, path: Path, source: Path) -> tuple[str, tuple[str, ...]]:
    """The digest of a file's code, and the names of modules of the package that it imports."""
    with _without_collection():
        tree = ast.parse(content, filename=str(path))
        statements = list(_statements(tree))
        names: set[str] = set()
        for node in statements:
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                base = _absolute(node, path, source)
                names.add(base)
                names.update(f"{base}.{alias.name}" for alias in node.names)
            elif (
                isinstance(node, _WITH_DOCSTRING)
                and ast.get_docstring(node, clean=False) is not None
            ):
                node.body = node.body[1:] or [ast.Pass()]
        digest = hashlib.sha256(ast.dump(tree).encode()).hexdigest()
    own = {name for name in names if name.partition(".")[0] == PACKAGE}
    return digest, tuple(sorted(own))


_WITH_DOCSTRING = ast.Module | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """The node and all statements below it: no import and no docstring stands in an expression."""
    yield node
    for part in ("body", "handlers", "orelse", "finalbody", "cases"):
        below = getattr(node, part, ())
        for child in below if isinstance(below, list) else ():
            yield from _statements(child)


@contextmanager
def _without_collection() -> Iterator[None]:
    """No garbage collection: a syntax tree is many objects and no garbage, and would be gone through again and again."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _absolute(node: ast.ImportFrom, path: Path, source: Path) -> str:
    if node.level == 0:
        return node.module or ""
    parts = [PACKAGE, *path.relative_to(source).with_suffix("").parts]
    parent = parts[: len(parts) - node.level]
    return ".".join([*parent, *([node.module] if node.module else [])])


@cache
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
