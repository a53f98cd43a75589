"""Parameters that a rule with `cache: True` needs, so that the shared cache never mixes results.

Snakemake's key for the shared cache holds script, parameters and the contents of inputs. It holds
neither the wildcards, nor which input plays which role, nor the modules that a script imports. Two
jobs that differ only in these would be given the same file. A cached rule therefore has all three
among its parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def wildcards_of(wildcards: Mapping[str, str]) -> dict[str, str]:
    """The wildcards of a job as a parameter."""
    return dict(sorted(wildcards.items()))


def roles_of(wildcards: Mapping[str, str], input: Any) -> dict[str, list[str]]:
    """Name of each input of a job -> its files, as a parameter."""
    return {
        name: [str(path) for path in ([paths] if isinstance(paths, str) else paths)]
        for name, paths in sorted(input.items())
    }
