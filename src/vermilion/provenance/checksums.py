"""Recorded checksums of every result, to find files that were damaged after their job ended.

Snakemake trusts what lies under a final name. The ledger `checksums.tsv` in the results folder is
written when a run ends; `verify` compares, names the damaged files and removes them, so that the
next run makes exactly these again.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from vermilion.storage.files import sha256_of
from vermilion.storage.tables import read_table, write_table

LEDGER = "checksums.tsv"
COLUMNS = ("path", "bytes", "mtime_ns", "sha256", "output", "job")
#: Two clocks and a file system's rounding lie between a file's time and its job's recorded end.
CLOCK_SLACK_S = 0.05
#: Why a file is not recorded.
CHANGED = "changed after its job had ended: run `make verify`"
CUT_OFF = "its job was cut off: the next run makes it again"


@dataclass(frozen=True)
class Damage:
    """A result that is not what its job wrote, with the reason."""

    path: Path
    reason: str


def record(
    results: Path, jobs: dict[Path, Path], finished_at: Callable[[Path], float | None]
) -> list[Damage]:
    """Bring the ledger up to date after a run; returns what must not be trusted.

    A file that is new or changed is recorded only where it is no younger than the recorded end of
    the job that wrote it; a younger one was changed by somebody else and keeps its old entry.

    Args:
        results: the results folder.
        jobs: each declared output, file or folder -> first output of the job that writes it, which
            stands for the job.
        finished_at: recorded end of the job that wrote an output, seconds since the epoch, or None
            where no finished job is known.
    """
    known = _read(results)
    entries, refused = {}, []
    for output, job in sorted(jobs.items()):
        end = finished_at(output)
        for path in _files_of(output):
            name = path.relative_to(results).as_posix()
            state = path.stat()
            entry = known.get(name)
            if entry and entry["bytes"] == state.st_size and entry["mtime_ns"] == state.st_mtime_ns:
                entries[name] = entry
            elif end is not None and state.st_mtime <= end + CLOCK_SLACK_S:
                entries[name] = {
                    "bytes": state.st_size,
                    "mtime_ns": state.st_mtime_ns,
                    "sha256": sha256_of(path),
                    "output": output.relative_to(results).as_posix(),
                    "job": job.relative_to(results).as_posix(),
                }
            else:
                refused.append(Damage(path, CHANGED if end is not None else CUT_OFF))
                if entry:
                    entries[name] = entry
    rows = [{"path": name, **entries[name]} for name in sorted(entries)]
    write_table(results / LEDGER, pd.DataFrame(rows, columns=list(COLUMNS)))
    return refused


def find_damage(results: Path) -> list[Damage]:
    """Results whose content differs from the ledger, or that are gone from within a folder."""
    damage = []
    for name, entry in _read(results).items():
        path, output = results / name, results / entry["output"]
        if not output.exists():
            continue  # removed as a whole: Snakemake sees that by itself
        if not path.is_file():
            damage.append(Damage(path, "missing"))
        elif path.stat().st_size != entry["bytes"]:
            damage.append(Damage(path, f"{path.stat().st_size} bytes, not {entry['bytes']}"))
        elif sha256_of(path) != entry["sha256"]:
            damage.append(Damage(path, "content differs from its recorded checksum"))
    return damage


def remove_damaged(results: Path, damage: list[Damage]) -> list[Path]:
    """Remove all outputs of the jobs that wrote damaged files; returns what was removed.

    A job makes its outputs together, so they go together: the next run misses the first of them.
    """
    known = _read(results)
    jobs = {known[item.path.relative_to(results).as_posix()]["job"] for item in damage}
    outputs = sorted({results / e["output"] for e in known.values() if e["job"] in jobs})
    for output in outputs:
        if output.is_dir():
            shutil.rmtree(output)
        else:
            output.unlink(missing_ok=True)
    return outputs


def _read(results: Path) -> dict[str, dict]:
    path = results / LEDGER
    if not path.is_file():
        return {}
    table = read_table(path)
    if list(table.columns) != list(COLUMNS):
        return {}  # of another version: it is written anew
    return {row.pop("path"): row for row in table.to_dict("records")}


def _files_of(output: Path) -> Iterator[Path]:
    if output.is_file():
        yield output
    elif output.is_dir():
        yield from sorted(
            p for p in output.rglob("*") if p.is_file() and p.name != ".snakemake_timestamp"
        )


def main(arguments: list[str]) -> int:
    """`python -m vermilion.provenance.checksums RESULTS`: name and remove damaged files."""
    results = Path(arguments[0])
    if not (results / LEDGER).is_file():
        print(f"{results / LEDGER}: no checksums recorded yet; run the workflow first")
        return 1
    damage = find_damage(results)
    for item in damage:
        print(f"damaged: {item.path} ({item.reason})")
    for output in remove_damaged(results, damage):
        print(f"removed: {output}")
    print(
        f"{len(damage)} damaged file(s) in {results}"
        + ("; run the workflow again to repair them" if damage else "")
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
