"""Intermediate results that were removed on purpose: they are not missed, and made again when a job needs them.

Snakemake makes a missing file only where it is asked for, or where a job that must run needs it. The workflow
asks for every result by name, so that a lost one is made again; those listed in `cleaned.txt` it leaves out as
long as they are gone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from vermilion.storage.files import remove_result, write_text

LIST = "cleaned.txt"


def cleaned(results: Path) -> frozenset[Path]:
    """Outputs that were removed on purpose, and are still gone."""
    return frozenset(results / name for name in _listed(results) if not (results / name).exists())


def forget_remade(results: Path) -> None:
    """Take those off the list that were made again: if they are lost, they are missed."""
    listed = _listed(results)
    gone = [name for name in listed if not (results / name).exists()]
    if gone != listed:
        _write(results, gone)


def intermediate_outputs(results: Path, patterns: Iterable[str]) -> list[Path]:
    """Files and folders in the results that match one of the workflow's patterns with {wildcards}."""
    found: list[Path] = []
    for pattern in patterns:
        inside = Path(pattern).relative_to(results).as_posix()
        found += results.glob(re.sub(r"\{\w+\}", "*", inside))
    return sorted(path for path in found if matches(path, patterns))


def matches(path: Path, patterns: Iterable[str]) -> bool:
    """Whether a path is one of the workflow's patterns, with a chunk, clip or frame of numbers."""
    return any(re.fullmatch(_expression(pattern), path.as_posix()) for pattern in patterns)


def bytes_of(path: Path) -> int:
    """Size of a file, or of all files in a folder."""
    files = [path] if path.is_file() else [inside for inside in path.rglob("*") if inside.is_file()]
    return sum(file.stat().st_size for file in files)


def clean(results: Path, outputs: Iterable[Path]) -> None:
    """Remove outputs; they are listed first, so that none is missed if this is killed midway."""
    names = [output.relative_to(results).as_posix() for output in outputs]
    _write(results, sorted({*_listed(results), *names}))
    for name in names:
        remove_result(results / name)


def _expression(pattern: str) -> str:
    """A regular expression of a pattern: names for people and takes, numbers for the rest."""
    parts = re.split(r"\{(\w+)\}", pattern)
    names = {"subject": r"[A-Za-z0-9_.]+", "take": r"[A-Za-z0-9_.]+"}
    return "".join(
        re.escape(part) if n % 2 == 0 else names.get(part, r"[\d-]+")
        for n, part in enumerate(parts)
    )


def _listed(results: Path) -> list[str]:
    path = results / LIST
    return path.read_text(encoding="utf-8").split("\n")[:-1] if path.is_file() else []


def _write(results: Path, names: list[str]) -> None:
    write_text(results / LIST, "".join(f"{name}\n" for name in names))
