"""The command that starts Snakemake with this environment's Python."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path


def snakemake_command(configuration: str | Path, options: Sequence[str] = ()) -> list[str]:
    """Words of a command that runs the workflow with a configuration and options of Snakemake."""
    return [python(), "-m", "snakemake", "--configfile", str(configuration), *options]


def python(executable: str = sys.executable) -> str:
    """A path of an environment's Python without blanks.

    Snakemake puts the path of Python into shell commands without quotes. Where the project lies in a
    folder with a blank in its name, a link in the folder for temporary files stands for the
    environment.
    """
    if not any(letter.isspace() for letter in executable):
        return executable
    environment = Path(executable).parent.parent
    name = hashlib.sha256(f"{environment} {os.getuid()}".encode()).hexdigest()[:12]
    link = Path(tempfile.gettempdir()) / f"vermilion-python-{name}"
    if not link.is_symlink() or link.readlink() != environment:
        fresh = link.with_name(f"{link.name}-{os.getpid()}")
        fresh.symlink_to(environment)
        fresh.replace(link)
    return str(link / Path(executable).relative_to(environment))
