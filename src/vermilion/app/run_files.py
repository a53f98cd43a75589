"""A configuration from a file, and where its results lie, outside of the workflow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vermilion.config.load import load_configuration, read_keys
from vermilion.config.root import Configuration
from vermilion.config.skip import without_skipped
from vermilion.config.takes import Take
from vermilion.storage.errors import InputError

#: The workflow's own list of paths, which is plain Python.
PATHS = Path("workflow/rules/paths.smk")


def read_configuration(path: str) -> tuple[Configuration, list[Take]]:
    """The checked configuration and take sheet of a file, without the takes that it leaves out."""
    return without_skipped(*load_configuration(read_keys(path), path))


def results_paths(config: Configuration, paths: Path = PATHS) -> Any:
    """The class `P` of the workflow's paths for a configuration."""
    names: dict[str, Any] = {"CONFIG": config}
    try:
        text = paths.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(
            "no workflow in this folder", f"the file {paths}", "Start it in Vermilion's folder."
        ) from error
    exec(compile(text, str(paths), "exec"), names)
    return names["P"]
