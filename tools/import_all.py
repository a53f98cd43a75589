"""Import each module of Vermilion and what Snakemake runs on, so that Python keeps them compiled."""

from __future__ import annotations

import contextlib
import importlib
import pkgutil

import vermilion

#: Other entry points: a program that runs when it is imported, and one for another environment.
_NOT_IMPORTED = ("__main__", "mediapipe_runner")
#: What is imported late: by Snakemake when it runs or reports, by functions of ours.
_LATE = (
    "snakemake.cli",
    "snakemake.script",
    "snakemake.report",
    "sklearn.linear_model",
    "trimesh",
    "pymeshlab",
)

names = [found.name for found in pkgutil.walk_packages(vermilion.__path__, "vermilion.")]
for name in [*names, *_LATE]:
    if not name.endswith(_NOT_IMPORTED):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
