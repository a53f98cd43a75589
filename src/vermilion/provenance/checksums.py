"""Recorded checksums of every result, to find files that were damaged after their job ended.

Snakemake trusts what lies under a final name. The ledger `checksums.tsv` in the results folder is
written when a run ends; `verify` compares, names the damaged files and removes them, so that the
next run makes exactly these again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from vermilion.storage.errors import InputError
from vermilion.storage.files import remove_result, sha256_of
from vermilion.storage.tables import read_table, write_table

LEDGER = "checksums.tsv"
COLUMNS = ("path", "bytes", "mtime_ns", "sha256", "output", "job", "ended_ns")
#: Two clocks and a file system's rounding lie between a file's time and its job's recorded end.
CLOCK_SLACK_S = 0.05
#: Why a file is not recorded.
CHANGED = "changed after its job had ended: run `make verify`"
OLDER = "older than the end of its job: run `make verify`"
GONE = "removed after its job had ended: run `make verify`"
CUT_OFF = "its job was cut off: the next run makes it again"


@dataclass(frozen=True)
class Damage:
    """A result that is not what its job wrote, with the reason.

    Attributes:
        path: the file, or the folder where all of it is wrong.
        reason: a few words.
        output: the declared output that it belongs to.
    """

    path: Path
    reason: str
    output: Path


def update_ledger(
    results: Path, jobs: dict[Path, Path], finished_at: Callable[[Path], float | None]
) -> list[Damage]:
    """Bring the ledger up to date after a run; returns what must not be trusted.

    A file that is new or changed is recorded only where its job has ended since the ledger was written
    and the file's time fits that end. What somebody else changed, replaced or removed keeps its
    old entry, and so do the outputs that this run did not know of.

    Args:
        results: the results folder.
        jobs: each declared output, file or folder -> first output of the job that writes it, which
            stands for the job.
        finished_at: recorded end of the job that wrote an output, seconds since the epoch, or None
            where no finished job is known.
    """
    before: dict[str, dict[str, dict]] = {}
    for name, entry in _read(results).items():
        before.setdefault(entry["output"], {})[name] = entry
    entries: dict[str, dict] = {}
    refused: list[Damage] = []
    for output, job in sorted(jobs.items()):
        label, end = output.relative_to(results).as_posix(), finished_at(output)
        old = before.pop(label, {})
        ended_ns = -1 if end is None else round(end * 1e9)
        again = not old or any(entry["ended_ns"] < ended_ns for entry in old.values())
        place = {
            "output": label,
            "job": job.relative_to(results).as_posix(),
            "ended_ns": ended_ns,
        }
        for path in _files_of(output):
            name = path.relative_to(results).as_posix()
            kept = old.pop(name, None)
            entry = _state(path, kept)
            same = kept is not None and entry["sha256"] == kept["sha256"]
            reason = "" if same else _reason(path, output, end, again)
            if not reason:
                entries[name] = {**entry, **(place if end is not None else {})}
            else:
                refused.append(Damage(path, reason, output))
                if kept is not None:
                    entries[name] = kept
        if not again:  # a job that ran again may write fewer files into its folder
            refused += [Damage(results / name, GONE, output) for name in sorted(old)]
            entries.update(old)
    for label, old in before.items():
        if (results / label).exists():
            entries.update(old)
    rows = [{"path": name, **entries[name]} for name in sorted(entries)]
    write_table(results / LEDGER, rows, COLUMNS)
    return refused


def _state(path: Path, kept: dict | None) -> dict:
    """The entry `kept` of a file where its size and time are as they were; else a new one."""
    state = path.stat()
    size, time = state.st_size, state.st_mtime_ns
    if kept is not None and (kept["bytes"], kept["mtime_ns"]) == (size, time):
        return kept
    return {**(kept or {}), "bytes": size, "mtime_ns": time, "sha256": sha256_of(path)}


def _reason(path: Path, output: Path, end: float | None, again: bool) -> str:
    """Why a new or changed file is not what its job wrote; empty where it can be.

    `again`: the job ended after the ledger was written.
    """
    if end is None:
        return CUT_OFF
    # A result of the shared cache may be a link, which is younger than its file.
    time = max(path.stat().st_mtime, path.lstat().st_mtime)
    if not again or time > end + CLOCK_SLACK_S:
        return CHANGED
    # The end of a job is the time of its output; a folder may hold files that are older.
    return OLDER if path == output and time < end - CLOCK_SLACK_S else ""


def find_damage(results: Path) -> list[Damage]:
    """Results whose content differs from the ledger, or that are gone from within a folder.

    An output that was removed as a whole is none: see `removed_outputs`.
    """
    damage = []
    for output, entries in _outputs(results).items():
        if output.is_dir() and not any(_files_of(output)):
            found = f"an empty folder, {len(entries)} file(s) are missing"
            damage.append(Damage(output, found, output))
        elif output.exists():
            found_of = {path: _difference(path, entry) for path, entry in entries.items()}
            damage += [Damage(path, found, output) for path, found in found_of.items() if found]
    return damage


def removed_outputs(results: Path) -> list[Path]:
    """Recorded outputs that are there no more; the next run makes those that it needs."""
    return [output for output in _outputs(results) if not output.exists()]


def foreign_files(results: Path) -> list[Path]:
    """Files in the folders of recorded outputs that no job wrote; hidden ones are left out."""
    return [
        path
        for output, entries in _outputs(results).items()
        for path in _files_of(output)
        if path not in entries and output not in entries
    ]


def _outputs(results: Path) -> dict[Path, dict[Path, dict]]:
    """Each recorded output with the entries of its files."""
    outputs: dict[Path, dict[Path, dict]] = {}
    for name, entry in _read(results).items():
        outputs.setdefault(results / entry["output"], {})[results / name] = entry
    return outputs


def _difference(path: Path, entry: dict) -> str:
    """How a file differs from its entry; empty where it does not."""
    if not path.is_file():
        return "missing"
    size = path.stat().st_size
    if size != entry["bytes"]:
        return f"{size} bytes, not {entry['bytes']}"
    return (
        "" if sha256_of(path) == entry["sha256"] else "content differs from its recorded checksum"
    )


def remove_damaged(results: Path, damage: list[Damage]) -> list[Path]:
    """Remove all outputs of the jobs that wrote damaged files; returns what was removed.

    A job makes its outputs together, so they go together: the next run misses the first of them.
    """
    known = _read(results)
    wrong = {item.output for item in damage}
    jobs = {entry["job"] for entry in known.values() if results / entry["output"] in wrong}
    outputs = sorted({results / e["output"] for e in known.values() if e["job"] in jobs})
    for output in outputs:
        remove_result(output)
    return outputs


def _read(results: Path) -> dict[str, dict]:
    path = results / LEDGER
    if not path.is_file():
        return {}
    table = read_table(path)
    if list(table.columns) != list(COLUMNS):
        return {}  # of another version: it is written anew
    if table.isna().to_numpy().any() or table["path"].duplicated().any():
        raise InputError(
            "checksums that are cut off or damaged",
            "a whole row for each result",
            "Remove the file: the next run records the results as they are then.",
            path=path,
        )
    return {row.pop("path"): row for row in table.to_dict("records")}


def _files_of(output: Path) -> Iterator[Path]:
    if output.is_file():
        yield output
    elif output.is_dir():
        yield from sorted(
            path for path in output.rglob("*") if path.is_file() and not path.name.startswith(".")
        )


def main(arguments: list[str]) -> int:
    """`python -m vermilion.provenance.checksums RESULTS`: name and remove damaged files; 1 where there are any."""
    results = Path(arguments[0])
    if not (results / LEDGER).is_file():
        print(f"{results / LEDGER}: no checksums recorded yet; run the workflow first")
        return 1
    damage = find_damage(results)
    for item in damage:
        print(f"damaged: {item.path} ({item.reason})")
    foreign = foreign_files(results)
    for path in foreign:
        print(f"foreign: {path} (no job wrote it: move it away, a job may read the whole folder)")
    gone = removed_outputs(results)
    if gone:
        print(
            f"{len(gone)} result(s) were removed as a whole, such as {gone[0]}: the next run makes "
            "those that it needs"
        )
    for output in remove_damaged(results, damage):
        print(f"removed: {output}")
    print(
        f"{len(damage)} damaged file(s) in {results}"
        + ("; run the workflow again to repair them" if damage else "")
    )
    return 1 if damage or foreign else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
