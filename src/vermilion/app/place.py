"""Where the project lies: the workflow is started from there, whatever folder a user is in."""

from __future__ import annotations

import os
from pathlib import Path

from vermilion.storage.errors import InputError


def project_folder() -> Path:
    """The folder with the Snakefile: the current one or one above it, else that of this library.

    Raises:
        InputError: there is none.
    """
    here = Path.cwd()
    library = Path(__file__).resolve().parents[3]
    for folder in (here, *here.parents, library):
        if (folder / "Snakefile").is_file() and (folder / "workflow" / "rules").is_dir():
            return folder
    raise InputError(
        "no Snakefile here or above",
        "the folder of the workflow",
        "Change to the folder that Vermilion was cloned to.",
        path=here,
    )


def from_here(path: str | Path, project: Path) -> str:
    """A user's path as the workflow names it: below the project relative to it, else absolute."""
    whole = Path(path).expanduser().absolute()
    return str(whole.relative_to(project)) if whole.is_relative_to(project) else str(whole)


def enter_project() -> Path:
    """Change to the project's folder, where all paths of configurations start."""
    folder = project_folder()
    os.chdir(folder)
    return folder


def enter_project_with(configuration: str) -> str:
    """The same; returns the path of a user's configuration as the workflow names it."""
    path = Path(configuration).absolute()
    return from_here(path, enter_project())
