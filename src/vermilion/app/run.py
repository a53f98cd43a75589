"""Run the workflow; where a take fails, make everything else and say which take, and why.

    python -m vermilion.app.run config/yours.yaml [options of Snakemake]
    python -m vermilion.app.run config/yours.yaml --only-report

Snakemake finishes every job that does not depend on a failed one, but the database, the measures and
the report depend on all takes. So the run is started again without the takes that failed
(`skip_takes`), until it succeeds or until what failed belongs to no take.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from vermilion.app.results import summary
from vermilion.app.snakemake_command import snakemake_command
from vermilion.app.workflow import TELLING, run_workflow
from vermilion.config.load import read_keys
from vermilion.config.root import Configuration
from vermilion.config.takes import Take, read_takes
from vermilion.provenance.run_lock import refuse_if_held
from vermilion.storage.logfile import FAILED_SUFFIX
from vermilion.storage.unwritable import is_of_the_disk, refuse_if_full


def failures(results: Path, takes: list[Take]) -> dict[str, str]:
    """Take (subject/take) -> why it failed, of the jobs that left a failure beside their logs.

    A job of a subject, such as the identity, fails all of the subject's takes.
    """
    found: dict[str, str] = {}
    for path in sorted((results / "logs").rglob(f"*{FAILED_SUFFIX}")):
        reason = path.read_text(encoding="utf-8").strip()
        job = path.name.removesuffix(FAILED_SUFFIX).removesuffix(".log").split("-")
        named = {take.name for take in takes if [take.subject, take.take] == job[:2]}
        if len(job) == 1:
            named = {take.name for take in takes if take.subject == job[0]}
        for name in named:
            found.setdefault(name, f"{path.parent.name}: {reason}")
    return found


def clear_failures(results: Path) -> None:
    """Forget what failed in earlier runs."""
    for path in (results / "logs").rglob(f"*{FAILED_SUFFIX}"):
        path.unlink(missing_ok=True)


def command(configuration: str, skipped: dict[str, str], options: list[str]) -> list[str]:
    """Snakemake without some takes."""
    words = snakemake_command(configuration, options)
    return [*words, "--config", f"skip_takes={json.dumps(skipped)}"] if skipped else words


def run_all(
    configuration: str,
    results: Path,
    takes: list[Take],
    options: list[str],
    left_out: dict[str, str],
    expected_s: Callable[[str], float] | None = None,
    alone: bool = False,
) -> tuple[int, dict[str, str]]:
    """Run until all but the takes that fail, and those that the configuration leaves out, is made.

    Args:
        expected_s: rule -> seconds that one of its jobs takes about.
        alone: whether a take that fails ends the run, as there is no other.

    Returns:
        (exit code of the first run, takes that were left out -> why); raises SystemExit where what
        failed belongs to no take or could not write, VermilionError where another run is at work
        in the folder, or the disk is full.
    """
    skipped, first = dict(left_out), 0
    if not TELLING.intersection(options):
        refuse_if_held(results)
        refuse_if_full(results)
        refuse_if_full(Path(".snakemake").absolute())
    while True:
        clear_failures(results)
        words = command(configuration, skipped, options)
        code = run_workflow(words, results / "logs" / "snakemake.log", expected_s)
        first = first or code
        new = {n: why for n, why in failures(results, takes).items() if n not in skipped}
        if code == 0:
            return first, skipped
        if not new or any(is_of_the_disk(why) for why in new.values()):
            raise SystemExit(code)
        skipped |= new
        if alone:
            return first, skipped
        print(_sentence("Failed; the run goes on without", new), file=sys.stderr, flush=True)


def write_report(configuration: str, results: Path, skipped: dict[str, str]) -> None:
    """Snakemake's own report of the run: report.html; raises SystemExit where it fails."""
    log = results / "logs" / "report.log"
    words = command(configuration, skipped, ["--report", str(results / "report.html")])
    made = subprocess.run(words, check=False, capture_output=True, text=True)
    log.write_text(made.stdout + made.stderr, encoding="utf-8")
    if made.returncode:
        print(made.stderr, file=sys.stderr)
        raise SystemExit(made.returncode)


def main(configuration: str, options: list[str]) -> int:
    """Run, write the report, say where to look; 0 where every take was made."""
    raw, results = read_keys(configuration), results_folder(configuration)
    takes, _ = read_takes(str(raw.get("takes", Configuration.model_fields["takes"].default)))
    code, skipped = 0, dict(raw.get("skip_takes", {}))
    if options != ["--only-report"]:
        code, skipped = run_all(configuration, results, takes, options, skipped)
    write_report(configuration, results, skipped)
    print("\n".join(summary(results)))
    if skipped and code:
        print(_sentence("Left out; all else was made", skipped), file=sys.stderr, flush=True)
    return code


def results_folder(configuration: str | Path) -> Path:
    """The folder of a configuration's results."""
    named = read_keys(configuration).get("results", Configuration.model_fields["results"].default)
    return Path(str(named))


def _sentence(head: str, takes: dict[str, str]) -> str:
    return "\n".join(["", f"{head}:", *(f"  {name}: {why}" for name, why in takes.items()), ""])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
