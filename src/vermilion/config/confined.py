"""Captures that nobody vouches for: no path of theirs leads out of the folders that are allowed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vermilion.config.root import Configuration
from vermilion.config.sheet_cells import read_cells
from vermilion.config.takes import STUDIO
from vermilion.imaging.source import folder_of, is_single_file

KEY = "capture.confined_to"
_USD = (".usd", ".usda", ".usdc", ".usdz")
_BESIDE = ("cameras", "labels", "calibration")
#: A capture that is full of links is named by its first ones.
_MOST = 10


def allowed_folders(raw: dict[str, Any]) -> list[Path]:
    """The folders of the key, of a configuration as it was read; none where captures are trusted."""
    capture = raw.get("capture")
    named = capture.get("confined_to") if isinstance(capture, dict) else None
    return [Path(str(folder)) for folder in named] if isinstance(named, list) else []


def sheet_problems(sheet: str, folders: list[Path]) -> list[str]:
    """Sources of a take sheet that lead out of the folders, before any of them is opened."""
    if not folders:
        return []
    try:
        rows, _ = read_cells(Path(sheet))
    except (OSError, ValueError):
        return []  # read_takes says why
    problems = []
    for number, row in enumerate(rows, start=1):
        source = row.get("source", "")
        if source and source != STUDIO and source.isprintable():
            place = f"{sheet}, row {number}, source"
            problems += [f"{place}: {problem}" for problem in _problems(source, folders)]
    return problems


def key_problems(
    configuration: Configuration, names: Iterable[dict[str, str]], folders: list[Path]
) -> list[str]:
    """Keys of the configuration that name data of captures, and lead out of the folders.

    Args:
        names: of each take, what stands for {subject}, {take} and the like in paths.
    """
    if not folders:
        return []
    problems = []
    for key, path in dict.fromkeys(_data_paths(configuration, list(names))):
        problems += [f"key {key}: {problem}" for problem in _problems(path, folders)]
    return problems


def _data_paths(
    configuration: Configuration, names: list[dict[str, str]]
) -> Iterator[tuple[str, str]]:
    landmarks, tracking = configuration.landmarks, configuration.tracking
    patterns = {
        "landmarks.files.path": landmarks.files.path,
        "landmarks.key_frames.files.path": landmarks.key_frames.files.path,
        "tracking.external.base.weights": tracking.external.base.weights,
        "tracking.external.flame": tracking.external.flame,
        "evaluation.truth": configuration.evaluation.truth,
        "apply.export.topology": configuration.apply.head_of("{subject}"),
        "apply.export.head.landmarks": configuration.apply.export.head.landmarks,
        "apply.export.rig": configuration.apply.export.rig,
    }
    for key, pattern in patterns.items():
        # Names of takes and cameras are no paths, so that what stands before them decides.
        yield from ((key, _filled(pattern, name)) for name in names if pattern)
    for subject, scan in tracking.scans.items():
        yield from ((f"tracking.scans.{subject}", p) for p in (scan.path, scan.landmarks) if p)
    for subject, person in configuration.studio.subjects.items():
        for take, settings in person.takes.items():
            if settings.csv:
                yield f"studio.subjects.{subject}.takes.{take}.csv", settings.csv


def _filled(pattern: str, names: dict[str, str]) -> str:
    """The path of a take; where it also depends on the camera, the folder in which it varies."""
    for name, value in names.items():
        pattern = pattern.replace(f"{{{name}}}", value)
    head, camera, _ = pattern.partition("{")
    return (head.rpartition("/")[0] or ".") if camera else pattern


def _problems(path: str, folders: list[Path]) -> list[str]:
    """What of a path leads out of the folders: itself, links within, files that a USD names."""
    roots = [folder.resolve() for folder in folders]
    shown = ", ".join(str(folder) for folder in folders)
    remedy = f"Move it there, or add its folder to the key {KEY}."
    real = _real(Path(path))
    if real is None or not _within(real, roots):
        return [f"found '{path}', which leads to '{real}'; expected a path in {shown}. {remedy}"]
    beside = [folder_of(path, name) for name in _BESIDE] if is_single_file(path) else []
    problems = []
    for found, reason in _leading_out([Path(path), *beside], roots):
        problems.append(
            f"found '{found}', {reason}; expected files and folders in {shown}. {remedy}"
        )
        if len(problems) == _MOST:
            break
    return problems


def _leading_out(paths: Iterable[Path], roots: list[Path]) -> Iterator[tuple[Path, str]]:
    """Files and links, of the paths and below them, that are not within the roots; why."""
    pending = [path for path in paths if os.path.lexists(path)]
    seen: set[Path] = set()
    while pending:
        path = pending.pop()
        real = _real(path)
        if real is None:
            yield path, "a link to itself"
        elif not _within(real, roots):
            yield path, f"a link to '{real}'"
        elif real.is_dir():
            if real not in seen:
                seen.add(real)
                pending += sorted(real.iterdir(), reverse=True)
        elif not real.is_file():
            yield path, "a broken link" if path.is_symlink() else "a pipe or a device"
        elif real.suffix.lower() in _USD:
            yield from ((path, f"which names '{n}'") for n in _named_by_usd(real, roots))


def _named_by_usd(path: Path, roots: list[Path]) -> Iterator[str]:
    """Files outside of the roots that a USD file names, also through others."""
    from pxr import Sdf, UsdUtils

    try:
        layers, assets, unresolved = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(path)))
    except Exception:  # a damaged file is named by its reader
        return
    named = [layer.realPath for layer in layers if layer.realPath] + list(assets)
    named += [str(path.parent / name) for name in unresolved]
    for name in named:
        outer = name.partition("[")[0]  # of a file within a .usdz
        if not _within(Path(outer).resolve(), roots):
            yield name


def _real(path: Path) -> Path | None:
    """The path with its links followed; None where they lead in a circle."""
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        return None


def _within(real: Path, roots: list[Path]) -> bool:
    return any(real.is_relative_to(root) for root in roots)
