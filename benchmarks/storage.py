"""What a finished run costs on disk and in core time, by stage and kind of take, for each frame.

    python -m benchmarks storage config/yours.yaml
    python -m benchmarks storage config/yours.yaml --frames 100000 --subjects 10

Bytes are those of the ledger `checksums.tsv`, as the last run left it; core
seconds those of `results/<name>/benchmarks/`. With `--frames`, half of them in rig takes and half in videos, the
whole is scaled: what belongs to a take grows with its frames, as the database and the training do with those of the
rig takes; what belongs to a subject grows with their number.
"""

from __future__ import annotations

import argparse
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.common import print_table
from vermilion.app.run_files import read_configuration, results_paths
from vermilion.config.takes import Take
from vermilion.provenance.checksums import LEDGER
from vermilion.provenance.cleaning import matches
from vermilion.storage.tables import read_table

RULES = Path(__file__).resolve().parents[1] / "workflow" / "rules"
RIG, VIDEO, SUBJECT, RUN = "rig take", "video", "subject", "run"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration of the run, and the size to scale to."""
    parser.add_argument("configuration", help="a YAML file whose run is finished")
    parser.add_argument("--frames", type=int, help="of a database to scale to")
    parser.add_argument("--subjects", type=int, default=10, help="of that database")


def run(arguments: argparse.Namespace) -> None:
    """Print the table, and the scaled one."""
    config, takes = read_configuration(arguments.configuration)
    results = Path(config.results)
    of_take = {(take.subject, take.take): take for take in takes}
    size, removed = bytes_by_stage(results, of_take, results_paths(config).intermediate)
    core_s = core_seconds_by_stage(results, of_take)
    count = {
        RIG: sum(len(take.frames) for take in takes if take.role == "tattoo"),
        VIDEO: sum(len(take.frames) for take in takes if take.role == "video"),
        SUBJECT: len({take.subject for take in takes if take.role == "tattoo"}),
        RUN: 1,
    }
    rows = [
        {
            "of": kind, "stage": stage, "kB_each": size[kind, stage] / count[kind] / 1e3,
            "kept_kB_each": (size[kind, stage] - removed[kind, stage]) / count[kind] / 1e3,
            "core_s_each": core_s[kind, stage] / count[kind],
        }
        for kind, stage in sorted(set(size) | set(core_s))
        if count[kind]
    ]  # fmt: skip
    print_table(rows)
    if arguments.frames:
        print_table(scaled(rows, arguments.frames, arguments.subjects))


def scaled(rows: list[dict], frames: int, subjects: int) -> list[dict]:
    """GB and core hours of a database of so many frames, by kind."""
    number = {RIG: frames / 2, VIDEO: frames / 2, SUBJECT: subjects, RUN: 1}
    return [
        {
            "of": kind,
            "GB": sum(row["kB_each"] for row in mine) * number[kind] / 1e6,
            "kept_GB": sum(row["kept_kB_each"] for row in mine) * number[kind] / 1e6,
            "core_h": sum(row["core_s_each"] for row in mine) * number[kind] / 3600,
        }
        for kind in number
        if (mine := [row for row in rows if row["of"] == kind])
    ]


def bytes_by_stage(
    results: Path, of_take: dict[tuple[str, str], Take], intermediate: Sequence[str]
) -> tuple[defaultdict, defaultdict]:
    """(kind, stage) -> bytes of all results, and of those that `clean-intermediate` removes."""
    size: defaultdict = defaultdict(int)
    removed: defaultdict = defaultdict(int)
    for row in read_table(results / LEDGER).to_dict("records"):
        parts = Path(row["path"]).parts
        if parts[0] in ("captures", "truth"):
            continue
        if parts[0] == "database":
            key = (RIG, "database")
        elif parts[0] in ("takes", "apply") and (parts[1], parts[2]) in of_take:
            key = (_kind(of_take[parts[1], parts[2]]), parts[3] if parts[0] == "takes" else "apply")
        else:
            key = (SUBJECT if parts[0] == "subjects" else RUN, parts[0])
        size[key] += row["bytes"]
        removed[key] += row["bytes"] if matches(results / row["output"], intermediate) else 0
    return size, removed


def core_seconds_by_stage(results: Path, of_take: dict[tuple[str, str], Take]) -> defaultdict:
    """(kind, stage) -> core seconds of all jobs but the studio's."""
    stage_of = dict(_rules())
    spent: defaultdict = defaultdict(float)
    for path in sorted((results / "benchmarks").rglob("*.tsv")):
        name = path.relative_to(results / "benchmarks").parts
        rule = name[0] if len(name) > 1 else path.stem
        stage = stage_of.get(rule, rule)
        if stage == "studio":
            continue
        job = path.stem.split("-") if len(name) > 1 else []
        take = of_take.get((job[0], job[1])) if len(job) > 1 else None
        people = {subject for subject, _ in of_take}
        kind = _kind(take) if take else SUBJECT if job and job[0] in people else RUN
        if stage in ("database", "training"):
            kind = RIG
        spent[kind, stage] += float(read_table(path)["cpu_time"].sum())
    return spent


def _kind(take: Take) -> str:
    return RIG if take.is_multiview else VIDEO


def _rules() -> Iterator[tuple[str, str]]:
    """Each rule with its stage."""
    for path in RULES.glob("*.smk"):
        for rule in re.findall(r"^\s*rule (\w+):", path.read_text(), re.MULTILINE):
            yield rule, path.stem
    yield "studio_take", "studio"
    yield "studio_rig", "studio"
