"""Run a rule's script as Snakemake does, without Snakemake."""

from __future__ import annotations

import importlib.util
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[2] / "workflow" / "scripts"


class Names(dict):
    """Named values as Snakemake passes them: by attribute and by name."""

    __getattr__ = dict.__getitem__


class Job:
    """What a script sees as `snakemake`."""

    def __init__(self, wildcards, params, input, output, log):
        self.wildcards, self.params = Names(wildcards), Names(params)
        self.input = Names({k: _text(v) for k, v in input.items()})
        self.output = Names({k: _text(v) for k, v in output.items()})
        self.log = [str(log)]


def _text(value):
    return [str(v) for v in value] if isinstance(value, list) else str(value)


def script(name: str):
    """The module `workflow/scripts/<name>.py`."""
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_script(name: str, *, wildcards=(), params=(), input=(), output=(), log="log") -> None:
    """Call `main` of `workflow/scripts/<name>.py`; standard output and error stay as they are."""
    job = Job(dict(wildcards), dict(params), dict(input), dict(output), log)
    script(name).main(job)
