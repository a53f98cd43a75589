"""Remove the intermediate results of a finished run."""

from __future__ import annotations

import subprocess
from collections import Counter
from pathlib import Path

from vermilion.app.run_files import read_configuration, results_paths
from vermilion.app.snakemake_command import snakemake_command
from vermilion.provenance.cleaning import bytes_of, clean, intermediate_outputs
from vermilion.provenance.run_lock import hold
from vermilion.storage.errors import InputError

_FINISHED = "Nothing to be done"


def clean_intermediate(configuration: str, dry_run: bool) -> str:
    """Remove what only the next stages read; returns what was removed, and how much that was.

    Raises:
        InputError: the run is not finished.
        FolderHeldError: a run is at work in the folder.
    """
    config, _ = read_configuration(configuration)
    results = Path(config.results)
    with hold(results):
        _refuse_unfinished(configuration, results)
        outputs = intermediate_outputs(results, results_paths(config).intermediate)
        sizes = {output: bytes_of(output) for output in outputs}
        if not dry_run:
            clean(results, outputs)
    return "\n".join([*_by_stage(results, sizes), _total(results, sum(sizes.values()), dry_run)])


def _refuse_unfinished(configuration: str, results: Path) -> None:
    """What the jobs that are still to be done need is not removed."""
    words = snakemake_command(configuration, ["--dry-run", "--cores", "1"])
    asked = subprocess.run(words, capture_output=True, text=True, check=False)
    if _FINISHED not in asked.stdout + asked.stderr:
        raise InputError(
            "jobs that are still to be done",
            "a finished run",
            f"Run `vermilion run {configuration}` first; with -n it says what is to be done.",
            path=results,
        )


def _by_stage(results: Path, sizes: dict[Path, int]) -> list[str]:
    """A line for each folder of a stage."""
    total: Counter[str] = Counter()
    for output, size in sizes.items():
        parts = output.relative_to(results).parts
        total["/".join((parts[0], "*", "*", *parts[3:-1]))] += size
    return [f"{size / 1e6:10.1f} MB  {name}" for name, size in total.most_common()]


def _total(results: Path, freed: int, dry_run: bool) -> str:
    whole = bytes_of(results) + (0 if dry_run else freed)
    does = "would free" if dry_run else "freed"
    share = 100 * freed / max(whole, 1)
    return f"{does} {freed / 1e6:.1f} MB of {whole / 1e6:.1f} MB ({share:.0f} %) in {results}"
